//! How many times light may be scattered: by kind, and altogether. Unlimited unless asked; limits lose light.

use serde::Serialize;

use crate::bsdf::Event;

/// Limits; `None` is no limit. What passes straight through a thin wall counts as transmitted, cut-outs do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DepthLimits {
    /// Of all events; 0 leaves what shines by itself, 1 direct light.
    pub total: Option<u32>,
    /// Of diffuse events.
    pub diffuse: Option<u32>,
    /// Of reflections by interfaces, rough or smooth.
    pub reflection: Option<u32>,
    /// Of transmissions by interfaces, rough or smooth.
    pub transmission: Option<u32>,
}

/// Events so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Depth {
    diffuse: u32,
    reflection: u32,
    transmission: u32,
}

impl Depth {
    /// All events.
    pub(super) fn total(self) -> u32 {
        self.diffuse + self.reflection + self.transmission
    }

    /// After another one.
    pub(super) fn after(mut self, event: Event) -> Self {
        match event {
            Event::Diffuse => self.diffuse += 1,
            Event::GlossyReflection | Event::SpecularReflection => self.reflection += 1,
            Event::GlossyTransmission | Event::SpecularTransmission | Event::Straight => self.transmission += 1,
        }
        self
    }

    pub(super) fn is_within(self, limits: &DepthLimits) -> bool {
        let within = |count: u32, limit: Option<u32>| limit.is_none_or(|limit| count <= limit);
        within(self.total(), limits.total)
            && within(self.diffuse, limits.diffuse)
            && within(self.reflection, limits.reflection)
            && within(self.transmission, limits.transmission)
    }
}
