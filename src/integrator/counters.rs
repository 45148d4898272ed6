//! What following chains costs.

/// What following chains has cost: proof of what was skipped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Rays cast into the scene.
    pub rays: u64,
    /// Chains followed.
    pub chains: u64,
    /// Refractions, reflections and mirrors.
    pub events: u64,
    /// Column updates: events and transfers times the columns carried.
    pub column_updates: u64,
    /// Second chains followed along the first-order motion.
    pub second_chains: u64,
    /// Chains traced again at another wavelength or pixel.
    pub retraces: u64,
    /// Texture coordinates looked up.
    pub uv_lookups: u64,
    /// Albedos looked up.
    pub albedo_lookups: u64,
    /// Surfaces left that the ray was never inside of: open or inconsistently oriented glass.
    pub unmatched_exits: u64,
    /// Chains that ended after too many events.
    pub exhausted: u64,
    /// Events redone with the geometric normal.
    pub geometric_normal_events: u64,
    /// Media left inside of another of the same priority: objects that overlap undecided.
    pub undecided_overlaps: u64,
    /// Surfaces that the camera does not see, clipped or hidden from it.
    pub unseen: u64,
}

impl Counters {
    fn combine(&self, other: &Self, f: impl Fn(u64, u64) -> u64) -> Self {
        Self {
            rays: f(self.rays, other.rays),
            chains: f(self.chains, other.chains),
            events: f(self.events, other.events),
            column_updates: f(self.column_updates, other.column_updates),
            second_chains: f(self.second_chains, other.second_chains),
            retraces: f(self.retraces, other.retraces),
            uv_lookups: f(self.uv_lookups, other.uv_lookups),
            albedo_lookups: f(self.albedo_lookups, other.albedo_lookups),
            unmatched_exits: f(self.unmatched_exits, other.unmatched_exits),
            exhausted: f(self.exhausted, other.exhausted),
            geometric_normal_events: f(self.geometric_normal_events, other.geometric_normal_events),
            undecided_overlaps: f(self.undecided_overlaps, other.undecided_overlaps),
            unseen: f(self.unseen, other.unseen),
        }
    }

    /// Adds another thread's counts.
    pub fn add(&mut self, other: &Self) {
        *self = self.combine(other, |a, b| a + b);
    }

    /// What was counted since `earlier`.
    pub fn since(&self, earlier: &Self) -> Self {
        self.combine(earlier, |now, before| now - before)
    }
}
