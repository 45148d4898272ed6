//! Motion: transforms and points that are linear between samples of time.
//!
//! Times are frames relative to the scene's own: time 0 is the frame itself, whose values stand beside the samples and are
//! taken exactly there. Between samples every number of a matrix or point is linear, before the first and after the last it
//! is held. That is what renderers do with motion samples, and it makes bounds exact: while time runs from one sample to the
//! next, a point runs along a straight line, and a box that holds it at both ends holds it all the way. What is curved (a
//! turning wheel) is as round as its samples are many; whoever samples decides.
//!
//! A transform may be singular at some time (scaled from nothing): nothing stands there then.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::Buffer;
use super::instances::affine;

/// Two samples and how far time is from the first to the second, 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Between {
    pub(super) first: usize,
    pub(super) second: usize,
    pub(super) fraction: f64,
}

impl Between {
    /// Of the increasing `times`, which are at least one.
    pub(super) fn find(times: &[f64], time: f64) -> Self {
        let after = times.partition_point(|&t| t <= time);
        if after == 0 || after == times.len() {
            let end = if after == 0 { 0 } else { times.len() - 1 };
            return Self { first: end, second: end, fraction: 0.0 };
        }
        let (t0, t1) = (times[after - 1], times[after]);
        Self { first: after - 1, second: after, fraction: (time - t0) / (t1 - t0) }
    }

    /// a at the first sample, b at the second: both ends exactly.
    pub(super) fn mix(&self, a: f64, b: f64) -> f64 {
        a + self.fraction * (b - a)
    }

    pub(super) fn mix_points(&self, a: DVec3, b: DVec3) -> DVec3 {
        a + self.fraction * (b - a)
    }

    fn mix_transforms(&self, a: &DAffine3, b: &DAffine3) -> DAffine3 {
        let mut mixed = *a;
        mixed.matrix3.x_axis = self.mix_points(a.matrix3.x_axis, b.matrix3.x_axis);
        mixed.matrix3.y_axis = self.mix_points(a.matrix3.y_axis, b.matrix3.y_axis);
        mixed.matrix3.z_axis = self.mix_points(a.matrix3.z_axis, b.matrix3.z_axis);
        mixed.translation = self.mix_points(a.translation, b.translation);
        mixed
    }
}

/// Transforms at increasing times.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    times: Vec<f64>,
    transforms: Vec<DAffine3>,
}

impl Track {
    /// `None` unless there is a transform for each time, at least one, and times are finite and increase.
    pub fn new(times: Vec<f64>, transforms: Vec<DAffine3>) -> Option<Self> {
        (are_increasing(&times) && times.len() == transforms.len()).then_some(Self { times, transforms })
    }

    fn at(&self, time: f64) -> DAffine3 {
        let between = Between::find(&self.times, time);
        between.mix_transforms(&self.transforms[between.first], &self.transforms[between.second])
    }
}

/// Whether `times` are some finite numbers, each larger than the one before.
pub fn are_increasing(times: &[f64]) -> bool {
    !times.is_empty() && times.iter().all(|t| t.is_finite()) && times.windows(2).all(|pair| pair[0] < pair[1])
}

/// A place that may move: the transform at the frame, and a track if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    frame: DAffine3,
    track: Option<Arc<Track>>,
}

impl From<DAffine3> for Pose {
    fn from(frame: DAffine3) -> Self {
        Self { frame, track: None }
    }
}

impl Pose {
    /// Moves along `track`; at time 0 it is at `frame`.
    pub fn moving(frame: DAffine3, track: Track) -> Self {
        Self { frame, track: Some(Arc::new(track)) }
    }

    /// The transform at the frame.
    pub fn frame(&self) -> &DAffine3 {
        &self.frame
    }

    /// The transform at `time`.
    pub fn at(&self, time: f64) -> DAffine3 {
        if time == 0.0 { self.frame } else { self.limit(time) }
    }

    /// The same by the samples alone, which need not agree with the frame: what motion tends to near time 0.
    pub(super) fn limit(&self, time: f64) -> DAffine3 {
        self.track.as_ref().map_or(self.frame, |track| track.at(time))
    }

    /// Whether it has a track.
    pub fn is_moving(&self) -> bool {
        self.track.is_some()
    }

    /// The times at which the motion may bend; none if it does not move.
    pub fn times(&self) -> &[f64] {
        self.track.as_ref().map_or(&[], |track| &track.times)
    }

    /// The pose of what stands at `inner` within this: exact at the samples of both, and linear between them.
    pub fn compose(&self, inner: &Self) -> Self {
        let frame = self.frame * inner.frame;
        if !self.is_moving() && !inner.is_moving() {
            return Self::from(frame);
        }
        let times = merged([self.times(), inner.times()]);
        let transforms = times.iter().map(|&t| self.limit(t) * inner.limit(t)).collect();
        Self { frame, track: Some(Arc::new(Track { times, transforms })) }
    }

    /// The same place at the frame, without motion.
    pub fn held(&self) -> Self {
        Self::from(self.frame)
    }
}

/// All of some increasing times, once each.
pub(super) fn merged<'a>(times: impl IntoIterator<Item = &'a [f64]>) -> Vec<f64> {
    let mut all: Vec<f64> = times.into_iter().flatten().copied().collect();
    all.sort_unstable_by(f64::total_cmp);
    all.dedup();
    all
}

/// Places of an array at other times than the frame: one buffer for each time, each as long as that of the frame.
#[derive(Clone, Debug)]
pub struct PlaceSamples {
    /// Increasing.
    pub times: Vec<f64>,
    /// Rows as in [`InstanceArray::places`](super::InstanceArray::places).
    pub places: Vec<Buffer<[f64; 12]>>,
}

impl PlaceSamples {
    pub(super) fn at(&self, place: usize, time: f64) -> DAffine3 {
        let between = Between::find(&self.times, time);
        let (a, b) = (affine(&self.places[between.first][place]), affine(&self.places[between.second][place]));
        between.mix_transforms(&a, &b)
    }
}

/// Points and normals of a mesh at other times than the frame, in its own order.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// Increasing.
    pub times: Vec<f64>,
    /// One buffer for each time, each with as many points as the mesh.
    pub points: Vec<Buffer<[f32; 3]>>,
    /// Shading normals as the mesh has them, one buffer for each time; those of the frame always hold if absent.
    pub normals: Option<Vec<Buffer<f32>>>,
}

impl Deformation {
    /// The points at a time.
    pub(super) fn at(&self, time: f64) -> Deformed<'_> {
        let between = Between::find(&self.times, time);
        Deformed { between, first: &self.points[between.first], second: &self.points[between.second] }
    }
}

/// Points between two samples.
#[derive(Clone, Copy)]
pub(super) struct Deformed<'a> {
    between: Between,
    first: &'a [[f32; 3]],
    second: &'a [[f32; 3]],
}

impl Deformed<'_> {
    /// Every triangle that has the point gets the same bits, so that edges stay shared.
    #[inline]
    pub(super) fn point(&self, index: u32) -> [f64; 3] {
        let (a, b) = (self.first[index as usize], self.second[index as usize]);
        std::array::from_fn(|axis| self.between.mix(a[axis].into(), b[axis].into()))
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact values are the law under test")]
mod tests {
    use super::*;

    fn track() -> Track {
        let at = |x: f64| DAffine3::from_translation(DVec3::X * x);
        Track::new(vec![-1.0, 0.5, 1.0], vec![at(0.0), at(3.0), at(10.0)]).unwrap()
    }

    #[test]
    fn motion_is_linear_between_samples_exact_at_them_and_held_beyond() {
        let pose = Pose::moving(DAffine3::from_translation(DVec3::X * 7.0), track());
        for (time, x) in [(-5.0, 0.0), (-1.0, 0.0), (-0.25, 1.5), (0.5, 3.0), (0.75, 6.5), (1.0, 10.0), (2.0, 10.0)] {
            assert_eq!(pose.at(time).translation.x, x, "{time}");
        }
        assert_eq!(pose.at(0.0).translation.x, 7.0, "the frame's own");
        assert_eq!(pose.held().at(0.5).translation.x, 7.0);
    }

    #[test]
    fn what_moves_within_what_moves_is_exact_at_the_samples_of_both() {
        let outer = Pose::moving(DAffine3::IDENTITY, track());
        let turned = DAffine3::from_rotation_z(0.3);
        let inner = Pose::moving(turned, Track::new(vec![0.0, 0.25, 1.0], vec![turned; 3]).unwrap());
        let both = outer.compose(&inner);
        assert_eq!(both.times(), [-1.0, 0.0, 0.25, 0.5, 1.0]);
        for time in [-1.0, 0.25, 0.5, 1.0] {
            assert_eq!(both.at(time), outer.at(time) * turned);
        }
        assert!(!Pose::from(turned).compose(&DAffine3::IDENTITY.into()).is_moving());
    }

    #[test]
    fn tracks_have_a_transform_for_each_of_increasing_times() {
        let some = |times: &[f64], n: usize| Track::new(times.to_vec(), vec![DAffine3::IDENTITY; n]).is_some();
        assert!(some(&[0.0, 1.0], 2) && some(&[3.0], 1));
        assert!(!some(&[0.0, 1.0], 1) && !some(&[], 0) && !some(&[0.0, 0.0], 2) && !some(&[0.0, f64::NAN], 2));
        assert!(!some(&[1.0, 0.0], 2) && !some(&[0.0, f64::INFINITY], 2));
    }
}
