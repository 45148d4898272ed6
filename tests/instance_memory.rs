//! What a million instances take, counted by the allocator.
#![allow(unsafe_code, reason = "an allocator that counts; it hands every call on to the system's, unchanged")]

mod support;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use abbe::scene::Scene;
use abbe::scene::description::{Array, Element, Group, Instances};
use abbe::scene::view::View;
use glam::{DAffine3, DMat4, DVec3};
use support::{BK7, Stagehand};

/// Bytes in use, and the most there have been.
static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: memory comes from and goes back to the system's allocator with the caller's own layouts; numbers are kept beside.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let live = LIVE.fetch_add(layout.size(), Ordering::Relaxed) + layout.size();
        PEAK.fetch_max(live, Ordering::Relaxed);
        // SAFETY: the caller's promises are the system's conditions.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const COUNT: usize = 1_000_000;

fn rows(places: impl Iterator<Item = DVec3>) -> Array {
    let rows: Vec<_> = places.map(|p| DAffine3::from_translation(p).to_cols_array()).collect();
    Array::from_vec(Element::F64, 12, rows)
}

/// A cloud without order: its tree has to be as large as that of a real one.
fn cloud(count: usize, size: f64) -> Array {
    let coordinate = |i: usize, prime: usize| (i * prime % count) as f64 / count as f64 * size;
    rows((0..count).map(|i| DVec3::new(coordinate(i, 7919), coordinate(i, 104_729), coordinate(i, 1_299_709))))
}

/// Bytes per instance that a scene and its view keep, and those that building them takes for a while.
fn bytes_beside_transforms(levels: &[(usize, f64)]) -> [f64; 2] {
    let mut s = Stagehand::new();
    let glass = s.glass("/World/Glass", BK7);
    s.sphere("/P/Ball", 0.4, DMat4::IDENTITY, Some(glass));
    let parts = s.document.groups[0].items.split_off(0);
    for (level, &(count, size)) in levels.iter().enumerate() {
        s.arrays.insert(format!("places{level}"), cloud(count, size));
        s.document.groups[level].instances.push(Instances {
            path: format!("/I{level}"),
            group: level + 1,
            transforms: format!("places{level}"),
            count,
            ..Instances::default()
        });
        s.document.groups.push(Group { path: format!("/P{level}"), ..Group::default() });
    }
    s.document.groups[levels.len()].items = parts;
    let description = s.description();
    let before = LIVE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let scene = Scene::build(description).unwrap_or_else(|e| panic!("{e}"));
    let view = View::new(&scene, DVec3::ZERO);
    assert_eq!(view.scene.objects.len() as usize, COUNT);
    let per_instance = |bytes: usize| (bytes - before) as f64 / COUNT as f64;
    [per_instance(LIVE.load(Ordering::Relaxed)), per_instance(PEAK.load(Ordering::Relaxed))]
}

// One test, since there is one allocator.
#[test]
fn an_instance_takes_a_hundred_bytes_beside_its_transform() {
    for levels in [&[(COUNT, 400.0)][..], &[(1000, 360.0), (1000, 40.0)]] {
        let [kept, peak] = bytes_beside_transforms(levels);
        assert!(kept <= 100.0, "{kept} bytes for each instance");
        // The tree's builder has boxes, codes and a binary tree beside it.
        assert!(peak <= 300.0, "{peak} bytes for each instance while the tree is built");
        assert!(kept > 4.0, "{kept} bytes hold no tree: nothing was counted");
    }
}
