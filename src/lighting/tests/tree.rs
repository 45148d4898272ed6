//! The light tree: probabilities that add up, nothing that is left out, orders that do not matter.

use std::f64::consts::PI;

use glam::DVec3;

use super::super::cone::Cone;
use super::super::tree::{LightBounds, LightTree, Way};
use super::{Random, deviations};
use crate::geometry::Bounds;

/// Small lights that shine to one side, in a cloud.
fn lights(count: usize, seed: u64) -> Vec<LightBounds> {
    let mut random = Random(seed);
    (0..count)
        .map(|_| {
            let center = 10.0 * (DVec3::new(random.next(), random.next(), random.next()) - 0.5);
            let half = DVec3::splat(0.02 * random.next());
            let is_lamp = random.next() < 0.3;
            LightBounds {
                bounds: Bounds { min: center - half, max: center + half },
                normals: if is_lamp { Cone::EVERYTHING } else { Cone { axis: random.direction(), angle: 0.0 } },
                emission_angle: PI / 2.0,
                is_two_sided: random.next() < 0.2,
                intensity: libm::exp(6.0 * random.next()),
            }
        })
        .collect()
}

fn build(lights: &[LightBounds]) -> (LightTree, Vec<Way>) {
    let mut ways = vec![None; lights.len()];
    let items = (0..).zip(lights.iter().copied()).collect();
    let tree = LightTree::build(items, |light, way| {
        assert!(ways[light as usize].replace(way).is_none(), "each light has one leaf");
    });
    (tree, ways.into_iter().map(|way| way.expect("each light has a leaf")).collect())
}

fn receivers() -> Vec<(DVec3, Option<DVec3>)> {
    let mut random = Random(11);
    (0..40)
        .map(|i| {
            let p = [1.0, 10.0, 100.0][i % 3] * (DVec3::new(random.next(), random.next(), random.next()) - 0.5);
            (p, (i % 2 == 0).then(|| random.direction()))
        })
        .collect()
}

/// A way that ends where nothing arrives of either half chooses nothing; all others are accounted for.
#[test]
fn probabilities_add_up_to_that_of_choosing_one() {
    for count in [1, 2, 3, 17, 1500] {
        let (tree, ways) = build(&lights(count, 5));
        for (p, n) in receivers() {
            let sum: f64 = ways.iter().map(|&way| tree.probability(p, n, way)).sum();
            let steps = 2000;
            let chosen =
                (0..steps).filter(|&i| tree.sample(p, n, || (f64::from(i) + 0.5) / f64::from(steps)).is_some());
            let part = chosen.count() as f64 / f64::from(steps);
            // The intervals of what is not chosen begin and end somewhere within a step.
            assert!((sum - part).abs() < 0.01 && sum < 1.0 + 1e-9, "{count} lights: {sum}, {part}");
        }
    }
    let lamps: Vec<_> = lights(200, 3).into_iter().map(|l| LightBounds { normals: Cone::EVERYTHING, ..l }).collect();
    let (tree, ways) = build(&lamps);
    for (p, _) in receivers() {
        let sum: f64 = ways.iter().map(|&way| tree.probability(p, None, way)).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }
}

/// ∫ over the numbers is what a probability says: at steps much finer than the probabilities.
#[test]
fn choices_have_the_probability_that_is_told() {
    let (tree, ways) = build(&lights(50, 9));
    for (p, n) in receivers().into_iter().take(6) {
        let steps = 100_000;
        let mut counts = vec![0.0; ways.len()];
        for i in 0..steps {
            let Some((light, probability)) = tree.sample(p, n, || (f64::from(i) + 0.5) / f64::from(steps)) else {
                continue;
            };
            let told = tree.probability(p, n, ways[light as usize]);
            assert_eq!(told.to_bits(), probability.to_bits(), "both are the same way down");
            counts[light as usize] += 1.0;
        }
        for (count, &way) in counts.iter().zip(&ways) {
            let expected = tree.probability(p, n, way) * f64::from(steps);
            assert!((count - expected).abs() < 2.0, "{count} of {expected}");
        }
    }
}

#[test]
fn what_shines_on_a_receiver_can_be_chosen() {
    let all = lights(300, 21);
    let (tree, ways) = build(&all);
    let mut random = Random(2);
    for (p, n) in receivers() {
        for (light, &way) in all.iter().zip(&ways) {
            for _ in 0..8 {
                let s = DVec3::new(random.next(), random.next(), random.next());
                let q = light.bounds.min + s * (light.bounds.max - light.bounds.min);
                let wi = (q - p).normalize();
                let leaves = light.normals.axis.dot(-wi);
                let is_lit = light.normals.angle >= PI || leaves > 0.0 || (light.is_two_sided && leaves < 0.0);
                if is_lit && n.is_none_or(|n| n.dot(wi) > 0.0) {
                    assert!(tree.probability(p, n, way) > 0.0);
                }
            }
        }
    }
}

/// The estimate of the sum of what lights send has less variance by the tree than by even choice, and the same mean.
#[test]
fn the_tree_agrees_with_even_choice_and_is_better() {
    let all = lights(400, 33);
    let (tree, _) = build(&all);
    let (p, n) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.6, 0.0, 0.8));
    let sent = |light: &LightBounds| {
        let to = 0.5 * (light.bounds.min + light.bounds.max) - p;
        let wi = to.normalize();
        let leaves = light.normals.axis.dot(-wi);
        let leaves = if light.normals.angle >= PI {
            1.0
        } else if light.is_two_sided {
            leaves.abs()
        } else {
            leaves.max(0.0)
        };
        light.intensity * leaves * n.dot(wi).max(0.0) / to.length_squared()
    };
    let exact: f64 = all.iter().map(sent).sum();
    let mut random = Random(8);
    let count = 20_000;
    let mut moments = [[0.0; 2]; 2];
    for _ in 0..count {
        let by_tree = tree.sample(p, Some(n), || random.next()).map_or(0.0, |(i, q)| sent(&all[i as usize]) / q);
        let i = ((random.next() * all.len() as f64) as usize).min(all.len() - 1);
        let evenly = sent(&all[i]) * all.len() as f64;
        for (moments, value) in moments.iter_mut().zip([by_tree, evenly]) {
            moments[0] += value;
            moments[1] += value * value;
        }
    }
    let [tree, even] = moments.map(|[sum, squares]| {
        let mean = sum / f64::from(count);
        (mean, (squares / f64::from(count) - mean * mean) / f64::from(count))
    });
    assert!((tree.0 - exact).abs() < 4.0 * tree.1.sqrt(), "{tree:?} {exact}");
    assert!((even.0 - exact).abs() < 4.0 * even.1.sqrt(), "{even:?} {exact}");
    assert!(tree.1 < 0.5 * even.1, "{tree:?} {even:?}");
}

#[test]
fn degenerate_clouds_have_trees() {
    let light = |center: DVec3| LightBounds {
        bounds: Bounds { min: center, max: center },
        normals: Cone::EVERYTHING,
        emission_angle: PI / 2.0,
        is_two_sided: false,
        intensity: 1.0,
    };
    let at_one_place = vec![light(DVec3::ONE); 1000];
    let on_a_line: Vec<_> = (0..1000).map(|i| light(DVec3::X * f64::from(i))).collect();
    let nested: Vec<_> = (0..500).map(|i| light(DVec3::X * libm::exp2(0.3 * f64::from(i - 250)))).collect();
    for cloud in [at_one_place, on_a_line, nested] {
        let (tree, ways) = build(&cloud);
        let p = DVec3::new(0.3, 0.7, 0.1);
        let sum: f64 = ways.iter().map(|&way| tree.probability(p, None, way)).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{sum}");
    }
    assert!(LightTree::build(Vec::new(), |_, _| ()).sample(DVec3::ZERO, None, || 0.5).is_none());
}

/// Spots that together look everywhere: none of them is lost where the cone of all has no axis.
#[test]
fn cones_hold_what_they_are_made_of() {
    let mut random = Random(4);
    for _ in 0..2000 {
        let cone = |random: &mut Random| Cone { axis: random.direction(), angle: PI * random.next() };
        let (a, b) = (cone(&mut random), cone(&mut random));
        let all = a.union(&b);
        for part in [a, b] {
            let [x, y] = super::super::shape::frame(part.axis);
            for i in 0..16 {
                let phi = 2.0 * PI * f64::from(i) / 16.0;
                let edge = part.angle.cos() * part.axis + part.angle.sin() * (phi.cos() * x + phi.sin() * y);
                assert!(edge.angle_between(all.axis) <= all.angle + 1e-7);
            }
        }
        assert!(all.angle <= PI);
    }
    // Of eight freedoms a χ² of 8 is nothing to wonder at; of 40 it is.
    assert!(deviations(8.0, 8.0).abs() < 1.0 && deviations(40.0, 8.0) > 3.5);
}
