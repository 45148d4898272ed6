//! Which medium a ray is in: glass in glass, cemented surfaces, overlapping objects, a camera under water.
//!
//! The stack remembers everything that was entered and not left. Where several overlap, the dielectric priority decides
//! (Schmidt & Budge, "Simple nested dielectrics in ray traced images", JGT 7(2), 2002): the strongest [`Priority`] wins,
//! and among equals the last entered.

/// Which medium wins where several overlap; the stronger one is the greater one.
///
/// Renderers number it in both orders. Schmidt & Budge, MoonRay and `abbe:dielectricPriority` let the lower number win,
/// Arnold the higher one. Both mean "unset" by 0. So that glass of both kinds can meet in one scene, the number n of
/// the one order counts as −n of the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Priority(Strength);

/// From weak to strong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Strength {
    /// Weaker than what has no priority: Arnold's negative ones.
    Below(i32),
    Unset,
    /// Larger is stronger. −1 − n for the number n where the lower wins, so that all of `i32` fits.
    Set(i32),
}

impl Priority {
    /// Not authored: weaker than every set one.
    pub const UNSET: Self = Self(Strength::Unset);

    /// From an order in which the lower number wins; 0 is unset.
    pub const fn lower_wins(number: i32) -> Self {
        // !n = −1 − n, which exists for every n.
        if number == 0 { Self::UNSET } else { Self(Strength::Set(!number)) }
    }

    /// From an order in which the higher number wins (Arnold's `dielectric_priority`); 0 is unset, negative numbers are
    /// weaker than that.
    pub const fn higher_wins(number: i32) -> Self {
        match number {
            0 => Self::UNSET,
            // −1 − (−n) = n − 1.
            1.. => Self(Strength::Set(number - 1)),
            _ => Self(Strength::Below(number)),
        }
    }
}

/// Index of a medium in the scene's table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MediumId(pub u32);

/// Something that was entered: the inside of one instance's glass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inside {
    /// The instance that was entered.
    pub instance: u32,
    /// Which of the instance's materials.
    pub slot: u32,
    /// The medium inside.
    pub medium: MediumId,
    /// Who wins where several overlap.
    pub priority: Priority,
}

/// The answer to leaving what was never entered: an open mesh, or normals that point the wrong way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotInside;

/// How many entered media need no memory of their own. Real scenes nest two or three deep.
const INLINE: usize = 4;

/// The media that a ray is inside of, in the order they were entered.
#[derive(Clone, Debug)]
pub struct MediaStack {
    inline: [Inside; INLINE],
    /// How many of `inline` count while `spill` is empty.
    len: usize,
    /// All entries, once they were more than `INLINE`; empty before and after.
    spill: Vec<Inside>,
}

impl Default for MediaStack {
    fn default() -> Self {
        Self::new()
    }
}

impl MediaStack {
    /// Outside of everything.
    pub const fn new() -> Self {
        const NOTHING: Inside = Inside { instance: 0, slot: 0, medium: MediumId(0), priority: Priority::UNSET };
        Self { inline: [NOTHING; INLINE], len: 0, spill: Vec::new() }
    }

    /// What was entered and not left, in order of entry.
    pub fn entries(&self) -> &[Inside] {
        if self.spill.is_empty() { &self.inline[..self.len] } else { &self.spill }
    }

    /// The medium that the ray travels in; `None` outside, where n = 1.
    pub fn current(&self) -> Option<MediumId> {
        strongest(self.entries(), None, None)
    }

    /// Goes inside. What is entered twice (overlapping shells of one instance) has to be left twice.
    pub fn enter(&mut self, inside: Inside) {
        if self.spill.is_empty() {
            if self.len < INLINE {
                self.inline[self.len] = inside;
                self.len += 1;
                return;
            }
            self.spill.extend_from_slice(&self.inline);
        }
        self.spill.push(inside);
    }

    /// Goes out of `inside`. Returns whether the ray was inside; if not, nothing changes.
    ///
    /// What is left is the last entry of the same instance and slot; where there is none, the last of the same medium: a
    /// bubble modelled as a shell of the glass around it, with its normals towards the air, leaves that glass.
    pub fn leave(&mut self, inside: &Inside) -> bool {
        let Some(index) = self.find(inside) else { return false };
        if self.spill.is_empty() {
            self.inline.copy_within(index + 1..self.len, index);
            self.len -= 1;
        } else {
            self.spill.remove(index);
            if self.spill.len() <= INLINE {
                self.len = self.spill.len();
                self.inline[..self.len].copy_from_slice(&self.spill);
                self.spill.clear();
            }
        }
        true
    }

    /// The medium behind a surface that enters `inside`.
    pub fn preview_enter(&self, inside: &Inside) -> Option<MediumId> {
        strongest(self.entries(), None, Some(inside))
    }

    /// The medium behind a surface that [leaves](Self::leave) `inside`.
    pub fn preview_leave(&self, inside: &Inside) -> Result<Option<MediumId>, NotInside> {
        let index = self.find(inside).ok_or(NotInside)?;
        Ok(strongest(self.entries(), Some(index), None))
    }

    /// Whether a surface that leaves `inside` lies within another medium that was entered later and is just as strong: the
    /// two objects overlap, neither holds the other, and no priority says whose the overlap is. On the way back it belongs
    /// to the other one.
    pub fn is_undecided(&self, inside: &Inside) -> bool {
        let Some(index) = self.find(inside) else { return false };
        let entries = self.entries();
        let left = &entries[index];
        entries[index + 1..].iter().any(|e| e.priority == left.priority && e.medium != left.medium)
            && entries.iter().all(|e| e.priority <= left.priority)
    }

    fn find(&self, inside: &Inside) -> Option<usize> {
        let entries = self.entries();
        let same_object = |entry: &Inside| entry.instance == inside.instance && entry.slot == inside.slot;
        entries.iter().rposition(same_object).or_else(|| entries.iter().rposition(|e| e.medium == inside.medium))
    }
}

/// The winner among `entries` without the one at `left` and with `entered` as the last.
fn strongest(entries: &[Inside], left: Option<usize>, entered: Option<&Inside>) -> Option<MediumId> {
    let mut winner: Option<&Inside> = None;
    let staying = entries.iter().enumerate().filter(|(index, _)| Some(*index) != left).map(|(_, entry)| entry);
    for entry in staying.chain(entered) {
        // `>=`: among equals the last entered wins.
        if winner.is_none_or(|best| entry.priority >= best.priority) {
            winner = Some(entry);
        }
    }
    winner.map(|entry| entry.medium)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(instance: u32, priority: i32) -> Inside {
        Inside { instance, slot: 0, medium: MediumId(100 + instance), priority: Priority::lower_wins(priority) }
    }

    fn medium(instance: u32) -> Option<MediumId> {
        Some(MediumId(100 + instance))
    }

    #[test]
    fn outside_is_no_medium() {
        let mut stack = MediaStack::new();
        assert_eq!(stack.current(), None);
        assert!(!stack.leave(&inside(0, 0)), "nothing was entered");
        assert_eq!(stack.preview_leave(&inside(0, 0)), Err(NotInside));
        assert_eq!(stack.preview_enter(&inside(3, 0)), medium(3));
        assert_eq!(stack.current(), None, "a preview changes nothing");
    }

    #[test]
    fn glass_in_glass_without_priorities_is_the_innermost() {
        let mut stack = MediaStack::new();
        stack.enter(inside(1, 0));
        stack.enter(inside(2, 0));
        assert_eq!(stack.current(), medium(2));
        assert_eq!(stack.preview_leave(&inside(2, 0)), Ok(medium(1)));
        assert!(stack.leave(&inside(2, 0)));
        assert_eq!(stack.current(), medium(1));
        assert!(stack.leave(&inside(1, 0)));
        assert_eq!(stack.current(), None);
    }

    #[test]
    fn overlapping_objects_may_be_left_in_any_order() {
        let mut stack = MediaStack::new();
        stack.enter(inside(1, 0));
        stack.enter(inside(2, 0));
        assert_eq!(stack.preview_leave(&inside(1, 0)), Ok(medium(2)), "the boundary of 1 inside of 2 changes nothing");
        assert!(stack.leave(&inside(1, 0)));
        assert_eq!(stack.current(), medium(2));
    }

    #[test]
    fn a_lower_priority_number_wins_and_unset_is_weakest() {
        let mut stack = MediaStack::new();
        stack.enter(inside(1, 1));
        assert_eq!(stack.preview_enter(&inside(2, 2)), medium(1), "liquid overlapping its glass stays glass");
        assert_eq!(stack.preview_enter(&inside(2, 0)), medium(1), "unset is weaker than any set one");
        assert_eq!(stack.preview_enter(&inside(2, 1)), medium(2), "among equals the last entered");
        assert_eq!(stack.preview_enter(&inside(2, -5)), medium(2));
        stack.enter(inside(2, 2));
        assert_eq!(stack.preview_leave(&inside(1, 0)), Ok(medium(2)));
        assert!(stack.leave(&inside(1, 0)));
        assert_eq!(stack.current(), medium(2));
    }

    #[test]
    fn a_number_of_one_order_is_its_negative_of_the_other() {
        for n in [1, 2, 17, i32::MAX] {
            assert_eq!(Priority::higher_wins(n), Priority::lower_wins(-n));
        }
        assert_eq!(Priority::lower_wins(0), Priority::UNSET);
        assert_eq!(Priority::higher_wins(0), Priority::UNSET);
    }

    #[test]
    fn priorities_are_ordered_by_strength() {
        let weak_to_strong = [
            Priority::higher_wins(i32::MIN),
            Priority::higher_wins(-2),
            Priority::higher_wins(-1),
            Priority::UNSET,
            Priority::lower_wins(i32::MAX),
            Priority::lower_wins(2),
            Priority::lower_wins(1),
            Priority::higher_wins(1),
            Priority::higher_wins(2),
            Priority::higher_wins(i32::MAX),
            Priority::lower_wins(i32::MIN),
        ];
        assert!(weak_to_strong.is_sorted_by(|a, b| a < b), "{weak_to_strong:?}");
    }

    #[test]
    fn arnolds_priorities_let_the_higher_win_and_the_negative_lose_to_unset() {
        let glass = |instance, priority| Inside { priority: Priority::higher_wins(priority), ..inside(instance, 0) };
        let mut stack = MediaStack::new();
        stack.enter(glass(1, 1));
        assert_eq!(stack.preview_enter(&glass(2, 2)), medium(2));
        assert_eq!(stack.preview_enter(&glass(2, 0)), medium(1));
        let mut stack = MediaStack::new();
        stack.enter(inside(1, 0));
        assert_eq!(stack.preview_enter(&glass(2, -1)), medium(1));
    }

    #[test]
    fn an_overlap_is_undecided_where_neither_of_two_equals_holds_the_other() {
        let stack = |entered: &[Inside]| {
            let mut stack = MediaStack::new();
            entered.iter().for_each(|&inside| stack.enter(inside));
            stack
        };
        for priority in [0, 3] {
            let overlap = stack(&[inside(1, priority), inside(2, priority)]);
            assert!(overlap.is_undecided(&inside(1, priority)), "2 was entered inside of 1 and goes on outside of it");
            assert!(!overlap.is_undecided(&inside(2, priority)), "2 lies inside of 1");
            assert!(!overlap.is_undecided(&inside(3, priority)), "never entered");
        }
        assert!(!stack(&[inside(1, 1), inside(2, 2)]).is_undecided(&inside(1, 1)), "1 is the stronger");
        assert!(!stack(&[inside(1, 2), inside(2, 1)]).is_undecided(&inside(1, 2)), "2 is the stronger");
        assert!(!stack(&[inside(3, 1), inside(1, 2), inside(2, 2)]).is_undecided(&inside(1, 2)), "neither is seen");
        let lump = |instance| Inside { medium: MediumId(7), ..inside(instance, 0) };
        assert!(!stack(&[lump(1), lump(2)]).is_undecided(&lump(1)), "two lumps of one glass");
    }

    #[test]
    fn entered_twice_is_left_twice() {
        let mut stack = MediaStack::new();
        stack.enter(inside(1, 0));
        stack.enter(inside(1, 0));
        assert!(stack.leave(&inside(1, 0)));
        assert_eq!(stack.current(), medium(1));
        assert!(stack.leave(&inside(1, 0)));
        assert!(!stack.leave(&inside(1, 0)));
    }

    #[test]
    fn a_bubble_modelled_as_a_shell_of_its_glass_leaves_the_glass() {
        let glass = |instance| Inside { instance, slot: 1, medium: MediumId(7), priority: Priority::UNSET };
        let mut stack = MediaStack::new();
        stack.enter(glass(1));
        assert_eq!(stack.preview_leave(&glass(2)), Ok(None));
        assert!(stack.leave(&glass(2)));
        assert_eq!(stack.current(), None, "in the air of the bubble");
        stack.enter(glass(2));
        assert!(stack.leave(&glass(1)));
        assert_eq!(stack.current(), None);
    }

    #[test]
    fn slots_of_one_instance_are_apart() {
        let mut stack = MediaStack::new();
        stack.enter(Inside { instance: 1, slot: 0, medium: MediumId(7), priority: Priority::UNSET });
        stack.enter(Inside { instance: 1, slot: 2, medium: MediumId(8), priority: Priority::UNSET });
        assert_eq!(
            stack.preview_leave(&Inside { instance: 1, slot: 1, medium: MediumId(9), priority: Priority::UNSET }),
            Err(NotInside)
        );
        assert!(stack.leave(&Inside { instance: 1, slot: 0, medium: MediumId(7), priority: Priority::UNSET }));
        assert_eq!(stack.current(), Some(MediumId(8)));
    }

    #[test]
    fn deep_nesting_spills_and_returns() {
        let mut stack = MediaStack::new();
        for instance in 0..40 {
            stack.enter(inside(instance, 0));
            assert_eq!(stack.current(), medium(instance));
            assert_eq!(stack.entries().len(), instance as usize + 1);
        }
        for instance in 0..39 {
            assert!(stack.leave(&inside(instance, 0)), "{instance}");
            assert_eq!(stack.entries().len(), 39 - instance as usize);
            assert_eq!(stack.current(), medium(39));
        }
        assert!(stack.leave(&inside(39, 0)));
        assert_eq!(stack.current(), None);
    }
}
