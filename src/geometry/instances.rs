//! Instances one by one and by the array: which shape stands where, in few bytes each.
//!
//! An array of n places and k parts stands for n·k instances but stores n transforms, shared with whoever brought them.
//! What follows from a transform is computed when a ray asks for it: that takes less time than reading it from memory
//! would, since neighbouring rays meet different instances.
//!
//! Instances are numbered: the single ones first, then array by array, place by place, part by part.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::motion::{PlaceSamples, Pose, merged};
use super::{Buffer, Shape};

/// A shape, placed.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed; shared by all its instances.
    pub shape: Arc<Shape>,
    /// Its place in the stage's world.
    pub world_from_object: Pose,
}

/// A shape within what an array places.
#[derive(Clone, Debug)]
pub struct Part {
    /// What is placed; shared by all its instances.
    pub shape: Arc<Shape>,
    /// Its place within that which the array places.
    pub place_from_object: Pose,
}

/// Shapes placed by an array of transforms: every part at every place. Cloning shares.
#[derive(Clone, Debug)]
pub struct InstanceArray {
    /// What stands at each place.
    pub parts: Arc<[Part]>,
    /// Array space from each place: the rows of USD's matrices without their last column, translation last.
    pub places: Buffer<[f64; 12]>,
    /// Where the places are at other times; always there if absent.
    pub motion: Option<PlaceSamples>,
    /// The stage's world from the array's space.
    pub world_from_array: Pose,
}

impl InstanceArray {
    /// The stage's world from the object space of `part` at `place`, at a time.
    pub fn world_from_object(&self, place: usize, part: usize, time: f64) -> DAffine3 {
        let part = &self.parts[part].place_from_object;
        match &self.motion {
            Some(motion) if time != 0.0 => self.world_from_array.at(time) * motion.at(place, time) * part.at(time),
            _ => self.world_from_array.at(time) * affine(&self.places[place]) * part.at(time),
        }
    }

    /// Whether anything of it moves.
    pub fn is_moving(&self) -> bool {
        self.motion.is_some()
            || self.world_from_array.is_moving()
            || self.parts.iter().any(|p| p.place_from_object.is_moving())
    }

    /// The times at which the motion of a part may bend.
    pub(super) fn times(&self, part: usize) -> Vec<f64> {
        let places = self.motion.as_ref().map_or(&[][..], |motion| &motion.times);
        merged([places, self.world_from_array.times(), self.parts[part].place_from_object.times()])
    }

    /// Where a part is from one time to another between which no motion bends: it stays within the hull of these. A place is
    /// a product of up to three transforms, each linear in time, so linear in each of three times: all their ends together
    /// are the corners of that.
    pub(super) fn corners(&self, place: usize, part: usize, [from, to]: [f64; 2]) -> impl Iterator<Item = DAffine3> {
        let part = &self.parts[part].place_from_object;
        let moves = [self.world_from_array.is_moving(), self.motion.is_some(), part.is_moving()];
        (0..8usize).filter(move |ends| (0..3).all(|level| moves[level] || ends >> level & 1 == 0)).map(move |ends| {
            let at = |level: usize| if ends >> level & 1 == 0 { from } else { to };
            let place = match &self.motion {
                Some(motion) => motion.at(place, at(1)),
                None => affine(&self.places[place]),
            };
            self.world_from_array.limit(at(0)) * place * part.limit(at(2))
        })
    }

    /// The same without motion.
    pub(crate) fn held(&self) -> Self {
        let hold =
            |part: &Part| Part { shape: Arc::clone(&part.shape), place_from_object: part.place_from_object.held() };
        let parts = if self.parts.iter().any(|p| p.place_from_object.is_moving()) {
            self.parts.iter().map(hold).collect()
        } else {
            Arc::clone(&self.parts)
        };
        Self { parts, places: self.places.clone(), motion: None, world_from_array: self.world_from_array.held() }
    }

    /// How many instances these are.
    pub fn len(&self) -> usize {
        self.places.len() * self.parts.len()
    }

    /// Whether nothing is placed.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Rows of a row-vector matrix are the columns of the map of column vectors.
pub(crate) fn affine(rows: &[f64; 12]) -> DAffine3 {
    let row = |i: usize| DVec3::new(rows[i], rows[i + 1], rows[i + 2]);
    DAffine3 { matrix3: DMat3::from_cols(row(0), row(3), row(6)), translation: row(9) }
}

/// Which instance has which number.
#[derive(Clone, Debug, Default)]
pub struct Numbering {
    singles: u32,
    /// Per array: its first number, and its parts.
    arrays: Vec<(u32, u32)>,
    len: u32,
}

/// Where an instance is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// One by one.
    Single(usize),
    /// In an array.
    InArray {
        /// Which.
        array: usize,
        /// Index of the place.
        place: usize,
        /// Index of the part.
        part: usize,
    },
}

impl Numbering {
    /// Of `singles` instances and of arrays with so many places and parts. Together they are less than 2^32.
    pub fn new(singles: usize, arrays: impl Iterator<Item = (usize, usize)>) -> Self {
        let number = |n: usize| u32::try_from(n).expect("instances are counted before they are placed");
        let mut next = singles;
        let arrays = arrays
            .filter(|(places, parts)| places * parts > 0)
            .map(|(places, parts)| {
                let first = next;
                next += places * parts;
                (number(first), number(parts))
            })
            .collect();
        Self { singles: number(singles), arrays, len: number(next) }
    }

    /// How many instances there are.
    pub fn len(&self) -> u32 {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Where the instance `index` < len is found.
    pub fn locate(&self, index: u32) -> Location {
        if index < self.singles {
            return Location::Single(index as usize);
        }
        let array = self.arrays.partition_point(|&(first, _)| first <= index) - 1;
        let (first, parts) = self.arrays[array];
        let (place, part) = ((index - first) / parts, (index - first) % parts);
        Location::InArray { array, place: place as usize, part: part as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_is_found_once_and_in_order() {
        let sizes = [(3, 2), (1, 1), (5, 3)];
        let numbering = Numbering::new(2, sizes.into_iter());
        let mut expected = vec![Location::Single(0), Location::Single(1)];
        for (array, (places, parts)) in sizes.into_iter().enumerate() {
            for place in 0..places {
                expected.extend((0..parts).map(|part| Location::InArray { array, place, part }));
            }
        }
        assert!((0..numbering.len()).map(|i| numbering.locate(i)).eq(expected));
    }
}
