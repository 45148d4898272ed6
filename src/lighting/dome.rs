//! Light from everywhere, sampled where the image is bright, or through portals.
//!
//! The image is averaged over cells of latitude and longitude in the environment's space, whatever its layout: a density that
//! is constant over each cell in solid angle, drawn by row and column (M. Pharr, W. Jakob, G. Humphreys, *Physically Based
//! Rendering*, 4th ed. 2023, §12.5.2). A small even part keeps every direction possible where an average misses what is there.
//! Without an image directions are even about the receiver's normal, weighted with the cosine, or all over the sphere.
//!
//! Portals are hints: half of the samples go through them, evenly over their solid angles, the others as if there were none,
//! and the density is that of both together.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::shape::{Directions, Rectangle, Toward, frame};
use crate::light::{Dome as Shape, Layout};
use crate::texture::{Lookup, Store};

/// The most rows of cells; there are twice as many columns. A third of a degree: a lamp or a sun is a few of them.
const MAX_ROWS: usize = 512;
/// The most lookups along a side of a cell.
const MAX_LOOKUPS: usize = 8;
/// Part of the density that is even over the sphere.
const EVEN: f64 = 0.01;
/// Share of the samples that portals have.
const THROUGH_PORTALS: f64 = 0.5;

/// A dome in render space.
#[derive(Debug)]
pub(super) struct Dome {
    /// Render space from the environment's.
    directions: Directions,
    image: Option<Image>,
    portals: Vec<Rectangle>,
    /// Mean over the sphere of the mean channel of the image, 1 without one.
    mean: f64,
}

/// What a dome looks like.
#[derive(Debug)]
struct Image {
    lookup: Lookup,
    layout: Layout,
    cells: Cells,
}

/// A density over cells of latitude and longitude.
#[derive(Debug)]
struct Cells {
    rows: usize,
    columns: usize,
    /// Sums of what is in the rows up to each; the last is 1.
    row_sums: Vec<f64>,
    /// The same within each row.
    column_sums: Vec<f32>,
    /// Density per solid angle.
    density: Vec<f32>,
}

impl Dome {
    /// `origin` is render space's zero in the world.
    pub(super) fn new(shape: &Shape, lookup: Option<&Lookup>, store: &Store, origin: DVec3) -> Self {
        let image = lookup.map(|lookup| Image::new(lookup.clone(), shape.layout, store));
        let portals = shape.portals.iter();
        let portals = portals.map(|p| Rectangle::new(p.center - origin, p.u, p.v, p.normal, true)).collect::<Vec<_>>();
        let (image, mean) = image.map_or((None, 1.0), |(image, mean)| (Some(image), mean));
        Self { directions: Directions::new(shape.environment_from_world.inverse()), image, portals, mean }
    }

    /// Mean of the image's channels over the sphere.
    pub(super) fn mean(&self) -> f64 {
        self.mean
    }

    /// Whether it differs by direction.
    pub(super) fn has_image(&self) -> bool {
        self.image.is_some()
    }

    /// What the image has in the direction `wi`; white without one.
    pub(super) fn looked_up(&self, store: &Store, wi: DVec3) -> [f64; 3] {
        let Some(image) = &self.image else { return [1.0; 3] };
        image.at(store, (self.directions.local_from_render * wi).normalize())
    }

    pub(super) fn sample(&self, p: DVec3, normal: Option<DVec3>, [mut u, v]: [f64; 2]) -> Option<Toward> {
        let portals = Portals::new(&self.portals, p);
        let wi = if portals.total > 0.0 && u < THROUGH_PORTALS {
            portals.sample(p, [u / THROUGH_PORTALS, v])?
        } else {
            if portals.total > 0.0 {
                u = (u - THROUGH_PORTALS) / (1.0 - THROUGH_PORTALS);
            }
            self.without_portals(normal, [u, v])
        };
        let pdf_solid_angle = self.density(&portals, p, normal, wi);
        (pdf_solid_angle > 0.0).then_some(Toward { wi, distance: f64::INFINITY, pdf_solid_angle })
    }

    pub(super) fn pdf(&self, p: DVec3, normal: Option<DVec3>, wi: DVec3) -> f64 {
        self.density(&Portals::new(&self.portals, p), p, normal, wi)
    }

    fn without_portals(&self, normal: Option<DVec3>, u: [f64; 2]) -> DVec3 {
        match (&self.image, normal) {
            (Some(image), _) => (self.directions.render_from_local * image.cells.sample(u)).normalize(),
            (None, Some(n)) => {
                let (radius, phi) = (u[0].sqrt(), 2.0 * PI * u[1]);
                let [x, y] = frame(n);
                radius * (libm::cos(phi) * x + libm::sin(phi) * y) + (1.0 - u[0]).sqrt() * n
            }
            (None, None) => sphere(u),
        }
    }

    fn density(&self, portals: &Portals<'_>, p: DVec3, normal: Option<DVec3>, wi: DVec3) -> f64 {
        let open = match (&self.image, normal) {
            (Some(image), _) => {
                let local = self.directions.local_from_render * wi;
                let length = local.length();
                self.directions.density(image.cells.density(local / length), 1.0 / length)
            }
            (None, Some(n)) => n.dot(wi).max(0.0) / PI,
            (None, None) => 0.25 / PI,
        };
        if portals.total > 0.0 {
            THROUGH_PORTALS * portals.density(p, wi) + (1.0 - THROUGH_PORTALS) * open
        } else {
            open
        }
    }
}

/// Even over the sphere.
fn sphere(u: [f64; 2]) -> DVec3 {
    let height = 1.0 - 2.0 * u[0];
    let (radius, phi) = ((4.0 * u[0] * (1.0 - u[0])).max(0.0).sqrt(), 2.0 * PI * u[1]);
    DVec3::new(radius * libm::cos(phi), radius * libm::sin(phi), height)
}

/// The portals as they are seen from a point.
struct Portals<'a> {
    seen: &'a [Rectangle],
    /// Of all solid angles.
    total: f64,
}

impl<'a> Portals<'a> {
    fn new(portals: &'a [Rectangle], p: DVec3) -> Self {
        Self { seen: portals, total: portals.iter().filter_map(|portal| portal.solid_angle(p)).sum() }
    }

    /// One in proportion to its solid angle, and a direction through it.
    fn sample(&self, p: DVec3, [u, v]: [f64; 2]) -> Option<DVec3> {
        let mut left = u * self.total;
        let mut last = None;
        for portal in self.seen {
            if let Some(solid_angle) = portal.solid_angle(p) {
                last = Some((portal, (left / solid_angle).min(1.0 - f64::EPSILON)));
                if left < solid_angle {
                    break;
                }
                left -= solid_angle;
            }
        }
        let (portal, u) = last?;
        Some(portal.sample_by_angle(p, [u, v])?.wi)
    }

    /// As often over the total as there are portals in that direction.
    fn density(&self, p: DVec3, wi: DVec3) -> f64 {
        let is_met = |portal: &&Rectangle| portal.solid_angle(p).is_some() && portal.meet(p, wi).is_some();
        self.seen.iter().filter(is_met).count() as f64 / self.total
    }
}

impl Image {
    /// With its mean over the sphere.
    fn new(lookup: Lookup, layout: Option<Layout>, store: &Store) -> (Self, f64) {
        let [width, height] = lookup.dimensions(store).unwrap_or([1, 1]);
        let layout = layout.unwrap_or_else(|| Layout::of_image(width, height));
        // Texels along the equator, of which a cell should not be smaller.
        let around = match layout {
            Layout::Latlong => width,
            Layout::MirroredBall | Layout::Angular => 2 * width,
            Layout::VerticalCross => width / 3 * 4,
        } as usize;
        let rows = (around / 2).clamp(1, MAX_ROWS);
        let columns = 2 * rows;
        // A lookup has a mean of four texels: every other corner of the texels sees all of them.
        let lookups = around.div_ceil(2 * columns).clamp(2, MAX_LOOKUPS);
        let mut image = Self { lookup, layout, cells: Cells::empty() };
        let step = |i: usize, k: usize| i as f64 + (k as f64 + 0.5) / lookups as f64;
        let means: Vec<f64> = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let image = &image;
                (0..columns).map(move |column| {
                    let mut sum = 0.0;
                    for j in 0..lookups {
                        let theta = PI * step(row, j) / rows as f64;
                        let (sine, cosine) = (libm::sin(theta), libm::cos(theta));
                        for i in 0..lookups {
                            let phi = 2.0 * PI * step(column, i) / columns as f64;
                            let d = DVec3::new(sine * libm::sin(phi), cosine, sine * libm::cos(phi));
                            sum += image.at(store, d).iter().sum::<f64>() / 3.0;
                        }
                    }
                    sum / (lookups * lookups) as f64
                })
            })
            .collect();
        let mean = image.cells.fill(rows, columns, &means);
        (image, mean)
    }

    fn at(&self, store: &Store, d: DVec3) -> [f64; 3] {
        let [s, t] = self.layout.image_coordinates(d);
        let texel = self.lookup.at(store, [s as f32, (1.0 - t) as f32]).unwrap_or([0.0; 4]);
        let [r, g, b, _] = texel;
        [r, g, b].map(|x| if x > 0.0 && x.is_finite() { f64::from(x) } else { 0.0 })
    }
}

impl Cells {
    fn empty() -> Self {
        Self { rows: 0, columns: 0, row_sums: Vec::new(), column_sums: Vec::new(), density: Vec::new() }
    }

    /// Solid angle of a cell of the row.
    fn solid_angle(&self, row: usize) -> f64 {
        let [low, high] = self.heights(row);
        (high - low) * 2.0 * PI / self.columns as f64
    }

    /// Of the row's borders over the equator, the lower one first.
    fn heights(&self, row: usize) -> [f64; 2] {
        [row + 1, row].map(|i| libm::cos(PI * i as f64 / self.rows as f64))
    }

    /// From the means over the cells; returns their mean over the sphere.
    fn fill(&mut self, rows: usize, columns: usize, means: &[f64]) -> f64 {
        (self.rows, self.columns) = (rows, columns);
        let total: f64 =
            (0..rows).map(|row| self.solid_angle(row) * means[row * columns..][..columns].iter().sum::<f64>()).sum();
        // What is black all over is sampled evenly, if at all.
        let (even, scale) = if total > 0.0 { (EVEN, (1.0 - EVEN) / total) } else { (1.0, 0.0) };
        let mut up_to = 0.0;
        for row in 0..rows {
            let solid_angle = self.solid_angle(row);
            let mut in_row = 0.0;
            let first = self.column_sums.len();
            let mut sums = Vec::with_capacity(columns);
            for mean in &means[row * columns..][..columns] {
                let density = scale * mean + even / (4.0 * PI);
                in_row += density * solid_angle;
                sums.push(in_row);
            }
            up_to += in_row;
            self.row_sums.push(up_to);
            self.column_sums.extend(sums.iter().map(|sum| (sum / in_row) as f32));
            // What is drawn is what the rounded sums say.
            let row_share = up_to - self.row_sums.len().checked_sub(2).map_or(0.0, |i| self.row_sums[i]);
            let mut before = 0.0;
            for &sum in &self.column_sums[first..] {
                self.density.push((row_share * f64::from(sum - before) / solid_angle) as f32);
                before = sum;
            }
        }
        let all = up_to;
        self.row_sums.iter_mut().for_each(|sum| *sum /= all);
        self.density.iter_mut().for_each(|density| *density = (f64::from(*density) / all) as f32);
        total / (4.0 * PI)
    }

    fn sample(&self, [u, v]: [f64; 2]) -> DVec3 {
        let row = self.row_sums.partition_point(|&sum| sum <= u).min(self.rows - 1);
        let from = row.checked_sub(1).map_or(0.0, |i| self.row_sums[i]);
        let t = ((u - from) / (self.row_sums[row] - from)).clamp(0.0, 1.0);
        let sums = &self.column_sums[row * self.columns..][..self.columns];
        let column = sums.partition_point(|&sum| f64::from(sum) <= v).min(self.columns - 1);
        let from = column.checked_sub(1).map_or(0.0, |i| f64::from(sums[i]));
        let s = ((v - from) / (f64::from(sums[column]) - from)).clamp(0.0, 1.0);
        let [low, high] = self.heights(row);
        let height = high + t * (low - high);
        let radius = ((1.0 - height) * (1.0 + height)).max(0.0).sqrt();
        let phi = 2.0 * PI * (column as f64 + s) / self.columns as f64;
        DVec3::new(radius * libm::sin(phi), height, radius * libm::cos(phi))
    }

    fn density(&self, d: DVec3) -> f64 {
        let theta = libm::atan2(libm::hypot(d.x, d.z), d.y);
        let turn = libm::atan2(d.x, d.z) / (2.0 * PI);
        let turn = if turn < 0.0 { turn + 1.0 } else { turn };
        let row = ((theta / PI * self.rows as f64) as usize).min(self.rows - 1);
        let column = ((turn * self.columns as f64) as usize).min(self.columns - 1);
        self.density[row * self.columns + column].into()
    }
}
