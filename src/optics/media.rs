//! Which medium a ray is in: glass in glass, cemented surfaces, overlapping objects, a camera under water.
//!
//! The stack remembers everything that was entered and not left. Where several overlap, the dielectric priority decides
//! (Schmidt & Budge, "Simple nested dielectrics in ray traced images", JGT 7(2), 2002): the lowest set priority wins, an
//! unset one is weaker than any set one, and among equals the last entered wins.

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
    /// Dielectric priority: lower wins; 0 is unset and weakest.
    pub priority: i32,
}

impl Inside {
    /// Order of strength: the smallest key wins. Unset comes after every set priority.
    fn rank(&self) -> (bool, i32) {
        (self.priority == 0, self.priority)
    }
}

/// The answer to leaving what was never entered: an open mesh, or normals that point the wrong way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotInside;

/// How many entered media need no memory of their own. Real scenes nest two or three deep.
const INLINE: usize = 16;

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
        const NOTHING: Inside = Inside { instance: 0, slot: 0, medium: MediumId(0), priority: 0 };
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
        // `<=`: among equals the last entered wins.
        if winner.is_none_or(|best| entry.rank() <= best.rank()) {
            winner = Some(entry);
        }
    }
    winner.map(|entry| entry.medium)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(instance: u32, priority: i32) -> Inside {
        Inside { instance, slot: 0, medium: MediumId(100 + instance), priority }
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
        let glass = |instance| Inside { instance, slot: 1, medium: MediumId(7), priority: 0 };
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
        stack.enter(Inside { instance: 1, slot: 0, medium: MediumId(7), priority: 0 });
        stack.enter(Inside { instance: 1, slot: 2, medium: MediumId(8), priority: 0 });
        assert_eq!(
            stack.preview_leave(&Inside { instance: 1, slot: 1, medium: MediumId(9), priority: 0 }),
            Err(NotInside)
        );
        assert!(stack.leave(&Inside { instance: 1, slot: 0, medium: MediumId(7), priority: 0 }));
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
