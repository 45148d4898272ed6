//! Light linking: which objects are in the link sets of the description.
//!
//! Without sets there is nothing here; with them one number per single object and per part of an array.

use super::description::{Description, Group, Placement};
use crate::error::{Error, Result};
use crate::geometry::Location;

/// Membership of all objects in all link sets.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    /// Whether lists name those outside of a set.
    excludes: Vec<bool>,
    /// Distinct lists of sets.
    lists: Vec<Vec<usize>>,
    /// List of each single object.
    singles: Vec<u32>,
    /// Lists of each array's parts.
    arrays: Vec<Vec<u32>>,
}

impl Links {
    /// With the sets of `description`.
    pub(super) fn new(description: &Description) -> Self {
        let excludes = description.document.link_sets.iter().map(|set| set.excludes).collect();
        Self { excludes, ..Self::default() }
    }

    /// Appends a single object.
    pub(super) fn push(&mut self, placement: &Placement) {
        if !self.excludes.is_empty() {
            let list = self.list(&placement.link_sets);
            self.singles.push(list);
        }
    }

    /// Appends an array of these parts; `common` is of all of them.
    pub(super) fn push_array<'a>(&mut self, parts: impl Iterator<Item = &'a Placement>, common: Option<&[usize]>) {
        if !self.excludes.is_empty() {
            let lists = parts.map(|part| self.list(common.unwrap_or(&part.link_sets))).collect();
            self.arrays.push(lists);
        }
    }

    /// The number of a list; there are few.
    fn list(&mut self, sets: &[usize]) -> u32 {
        let known = self.lists.iter().position(|list| list == sets);
        known.unwrap_or_else(|| {
            self.lists.push(sets.to_vec());
            self.lists.len() - 1
        }) as u32
    }

    /// Whether the object at `location` is in `set`.
    pub(super) fn contains(&self, set: u32, location: Location) -> bool {
        let list = match location {
            Location::Single(i) => self.singles[i],
            Location::InArray { array, part, .. } => self.arrays[array][part],
        };
        let is_listed = self.lists[list as usize].binary_search(&(set as usize)).is_ok();
        is_listed != self.excludes[set as usize]
    }
}

/// Every list increases and stays within the sets.
pub(super) fn check(description: &Description) -> Result<()> {
    let count = description.document.link_sets.len();
    let check = |place: &str, sets: &[usize]| {
        let increases = sets.windows(2).all(|pair| pair[0] < pair[1]);
        if increases && sets.last().is_none_or(|&last| last < count) {
            return Ok(());
        }
        Err(Error::scene(
            place,
            format!("has the link sets {sets:?} of {count}: the scene file is damaged, export it again"),
        ))
    };
    for Group { items, instances, lights, .. } in &description.document.groups {
        for item in items {
            check(&item.path, &item.link_sets)?;
        }
        for instances in instances {
            check(&instances.path, instances.link_sets.as_deref().unwrap_or(&[]))?;
        }
        for light in lights {
            for set in [light.light_link, light.shadow_link].into_iter().flatten() {
                check(&light.path, &[set])?;
            }
        }
    }
    Ok(())
}
