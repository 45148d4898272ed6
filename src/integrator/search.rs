//! What is seen at one place of the raster, found at another: at another wavelength, or at another time.

use glam::{DVec2, DVec3};

use super::chain::{Chain, Counters, End};
use crate::ray::{ColumnSet, ScreenColumns, direction_derivative, screen_motion};

/// The end of a chain as screen motion sees it: a point on a surface, or a direction.
#[derive(Clone, Copy)]
pub(super) struct EndState {
    pub(super) kind: EndKind,
    /// The point or the direction.
    pub(super) value: DVec3,
    /// n_g or the direction.
    pub(super) normal: DVec3,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum EndKind {
    Surface,
    Miss,
    None,
}

impl EndState {
    pub(super) fn new<C>(chain: &Chain<C>) -> Self {
        match &chain.end {
            End::Surface(met) => Self { kind: EndKind::Surface, value: met.point, normal: met.surface.n_g },
            End::Miss => Self { kind: EndKind::Miss, value: chain.direction, normal: chain.direction },
            End::Exhausted => Self { kind: EndKind::None, value: DVec3::ZERO, normal: DVec3::ZERO },
        }
    }

    pub(super) fn exists(&self) -> bool {
        self.kind != EndKind::None
    }

    /// From here to `other`, if both are of one kind.
    fn difference_to(&self, other: &Self) -> Option<DVec3> {
        (self.kind == other.kind && self.exists()).then(|| other.value - self.value)
    }

    /// ∂/∂x and ∂/∂y of the point or direction.
    pub(super) fn screen_columns<C: ColumnSet>(&self, chain: &Chain<C>) -> Option<[DVec3; 2]> {
        let columns = chain.columns.screen()?;
        match self.kind {
            EndKind::Surface => Some(columns.map(|c| c.point)),
            EndKind::Miss => {
                Some(columns.map(|c| direction_derivative(c.momentum, chain.direction, chain.medium.ior, 0.0)))
            }
            EndKind::None => None,
        }
    }
}

/// What is looked for: the end of a chain with as many events.
#[derive(Clone, Copy)]
pub(super) struct Wanted {
    pub(super) end: EndState,
    pub(super) interfaces: u32,
    pub(super) total_reflections: u32,
}

impl Wanted {
    /// The end of `chain`.
    pub(super) fn of<C>(chain: &Chain<C>) -> Self {
        let Chain { interfaces, total_reflections, .. } = *chain;
        Self { end: EndState::new(chain), interfaces, total_reflections }
    }

    /// The offset on the raster (pixels, y up) where `follow` gives a chain that ends there. Newton's method with the screen
    /// columns, started from `offset`, until a step no longer changes it.
    pub(super) fn find(
        &self,
        mut offset: DVec2,
        counters: &mut Counters,
        mut follow: impl FnMut(DVec2, &mut Counters) -> Chain<ScreenColumns>,
    ) -> Option<DVec2> {
        /// Newton doubles the digits at each step: eight reach the last one from any start that converges at all.
        const MAX_STEPS: usize = 8;
        /// Where steps below this many pixels stop to shrink is decided by rounding of the hit point: a thousandth of
        /// what an EXR float can tell at one pixel.
        const CONVERGED: f64 = 1e-10;
        /// Offsets that still move by more than this have no digits worth writing.
        const ACCEPTED: f64 = 1e-6;

        let mut last_step = f64::INFINITY;
        for _ in 0..MAX_STEPS {
            counters.retraces += 1;
            let chain = follow(offset, counters);
            if chain.interfaces != self.interfaces || chain.total_reflections != self.total_reflections {
                return None;
            }
            let here = EndState::new(&chain);
            let residual = here.difference_to(&self.end)?;
            let [v_x, v_y] = here.screen_columns(&chain)?;
            let step = screen_motion(v_x, v_y, -residual, here.normal)?;
            offset += step;
            let length = step.length();
            if length <= CONVERGED || (length >= last_step && length <= ACCEPTED) {
                return Some(offset);
            }
            last_step = length;
        }
        (last_step <= ACCEPTED).then_some(offset)
    }
}
