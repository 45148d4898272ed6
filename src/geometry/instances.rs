//! Instances one by one and by the array: which shape stands where, in few bytes each.
//!
//! An array of n places and k parts stands for n·k instances but stores n transforms, shared with whoever brought them.
//! What follows from a transform is computed when a ray asks for it: that takes less time than reading it from memory
//! would, since neighbouring rays meet different instances.
//!
//! Instances are numbered: the single ones first, then array by array, place by place, part by part.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::{Buffer, Shape};

/// A shape, placed.
#[derive(Clone, Debug)]
pub struct Instance {
    /// What is placed; shared by all its instances.
    pub shape: Arc<Shape>,
    /// Its place in the stage's world.
    pub world_from_object: DAffine3,
}

/// A shape within what an array places.
#[derive(Clone, Debug)]
pub struct Part {
    /// What is placed; shared by all its instances.
    pub shape: Arc<Shape>,
    /// Its place within that which the array places.
    pub place_from_object: DAffine3,
}

/// Shapes placed by an array of transforms: every part at every place. Cloning shares.
#[derive(Clone, Debug)]
pub struct InstanceArray {
    /// What stands at each place.
    pub parts: Arc<[Part]>,
    /// Array space from each place: the rows of USD's matrices without their last column, translation last.
    pub places: Buffer<[f64; 12]>,
    /// The stage's world from the array's space.
    pub world_from_array: DAffine3,
}

impl InstanceArray {
    /// The stage's world from the place `place`.
    pub fn world_from_place(&self, place: usize) -> DAffine3 {
        self.world_from_array * affine(&self.places[place])
    }

    /// The stage's world from the object space of `part` at `place`.
    pub fn world_from_object(&self, place: usize, part: usize) -> DAffine3 {
        self.world_from_place(place) * self.parts[part].place_from_object
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
