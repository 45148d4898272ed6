//! `reference`: the slow truth that judges the other integrators.
//!
//! One wavelength a path, drawn uniformly from 360–830 nm; where the path goes, the BSDF alone decides; light counts where the path
//! happens to meet it. No companions, no stratification, no multiple importance sampling, no columns. Light that no path can
//! meet (parallel light, points, lines, light whose shadows are not those of what is in the way) is the one exception: it is
//! sampled. Of `path` it shares what is not an estimator: rays and media, surfaces, one sample of a BSDF, what lights emit.

use std::ops::Range;

use glam::{DMat3, DVec3};

use super::chain::{Counters, Follower};
use super::frame::Frame;
use super::lanes::{Laws, PathMedia};
use super::walk::{MAX_CROSSINGS, SurfacePoint, Walk};
use super::{Integrator, PreparedIntegrator, Task, Worker, surface};
use crate::bsdf::{Bsdf, Interface, Scattered};
use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::film::aov::{AOVS, Aov, COLOR, SAMPLE_COUNT, SPECTRAL, VARIANCE};
use crate::film::pixel::PixelAccumulator;
use crate::geometry::Ray;
use crate::light::Light;
use crate::lighting::{LightHit, LightSample, Lighting, Receiver};
use crate::ray::{ScatterKind, mirror, refract_or_reflect};
use crate::sampler::PathSampler;
use crate::spectrum::reflectance::Reflectance;
use crate::spectrum::{SampledSpectrum, Wavelengths, sensor, visible};

/// From this vertex on roulette may end a path.
const ROULETTE_FROM: u32 = 8;

/// The integrator; it has no settings of its own.
#[derive(Clone, Copy, Debug)]
pub struct Reference;

impl Integrator for Reference {
    fn name(&self) -> &str {
        "reference"
    }

    fn summary(&self) -> &str {
        "the slow truth: one wavelength a path, brute force; judges the other integrators"
    }

    fn aovs(&self) -> Vec<&'static Aov> {
        AOVS.iter().filter(|aov| matches!(aov.name, COLOR | VARIANCE | SAMPLE_COUNT | SPECTRAL)).collect()
    }

    fn transports_light(&self) -> bool {
        true
    }

    fn prepare<'a>(&self, task: &'a Task<'a>) -> Result<Box<dyn PreparedIntegrator + 'a>> {
        Ok(Box::new(Prepared {
            task,
            follower: Follower::of_camera(task.view, task.camera),
            lighting: Lighting::new(task.view)?,
            laws: Laws::new(task.view.scene, task.optics.dispersion_scale)?,
        }))
    }
}

struct Prepared<'a> {
    task: &'a Task<'a>,
    follower: Follower<'a>,
    lighting: Lighting<'a>,
    laws: Laws<'a>,
}

impl PreparedIntegrator for Prepared<'_> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        Box::new(BruteForce {
            prepared: self,
            media: PathMedia::new(&self.laws, visible::uniform(0.5)),
            color_from_xyz: self.task.color_space.from_xyz(),
            counters: Counters::default(),
        })
    }

    fn diagnostics(&self) -> Diagnostics {
        self.lighting.diagnostics().clone()
    }
}

struct BruteForce<'a> {
    prepared: &'a Prepared<'a>,
    media: PathMedia<'a, 1>,
    color_from_xyz: DMat3,
    counters: Counters,
}

impl Worker for BruteForce<'_> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        let task = self.prepared.task;
        for index in range {
            let ray = task.camera.ray(&task.sampler.sample(pixel, index));
            let mut numbers = task.sampler.independent(pixel, index);
            let [u, ..] = numbers.draw();
            let wavelengths = visible::uniform(u.into());
            self.media.restart(wavelengths);
            let mut walk = Walk::new(&self.prepared.follower, &ray);
            let (radiance, alpha) = self.follow(&mut walk, &wavelengths, &mut numbers);
            let radiance = SampledSpectrum([radiance]);
            let DVec3 { x, y, z } = self.color_from_xyz * sensor::xyz(radiance, &wavelengths);
            let scale = out.add_color([x, y, z, alpha]);
            out.add_spectrum(radiance, &wavelengths, scale);
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

impl<'a> BruteForce<'a> {
    /// Radiance per nm along the walk, and whether there is a surface.
    fn follow(&mut self, walk: &mut Walk<'a>, wavelengths: &Wavelengths<1>, numbers: &mut PathSampler) -> (f32, f64) {
        let Prepared { task, lighting, .. } = self.prepared;
        // The last is the squared index of the medium over that of the first.
        let (mut radiance, mut throughput, mut vertices, mut squeezed) = (0.0, 1.0, 0, 1.0);
        let mut last: Option<LastEvent> = None;
        loop {
            let met: Option<SurfacePoint> = walk.advance(&mut self.counters);
            let ray = walk.ray;
            let medium = self.media.of(walk.media.current());
            let through = |distance: f64| medium.transmittance(distance).map_or(1.0, |t| t.hero());
            let limit = met.as_ref().map_or(f64::INFINITY, |met| met.hit.distance);
            let received = |light: &LightHit<1>| {
                let share = last.as_ref().map_or(1.0, |last| last.receives(lighting, ray.direction, light));
                share * light.radiance.hero()
            };
            lighting.along(&ray, limit, wavelengths, &mut |light| {
                radiance += throughput * through(light.distance) * received(&light);
            });
            let alpha = f64::from(u8::from(vertices > 0));
            let Some(mut met) = met else {
                lighting.environment(&ray, wavelengths, &mut |light| {
                    radiance += throughput * through(f64::INFINITY) * received(&light);
                });
                return (radiance, alpha);
            };
            throughput *= through(limit);
            walk.in_contact(&mut met, &mut self.counters);
            let inside = task.view.inside(&met.hit, met.material_id);
            let mut far = inside.map(|_| walk.far_side(&met, &mut self.counters));
            let far_medium = far.as_ref().map_or(medium, |far| self.media.of(far.medium));
            let interface = Interface { ior_i: medium.iors, ior_t: far_medium.iors };
            let at = task.view.surface(&met.hit, met.material_id, wavelengths, interface);
            let [u_there, u_light, u_x, u_y] = numbers.draw();
            if walk.crossings > MAX_CROSSINGS {
                return (radiance, alpha);
            }
            if u_there >= at.presence {
                walk.cross(&met);
                continue;
            }
            if let Some(far) = far.take_if(|far| far.medium == walk.media.current()) {
                walk.pass(&met, far);
                continue;
            }
            vertices += 1;
            if let Some(light) = lighting.emitted(&ray, &met.hit, wavelengths) {
                radiance += throughput * received(&light);
            }
            if lighting.replaces_material(&met.hit) {
                return (radiance, 1.0);
            }
            let (normal, tangent) =
                surface::normal_and_tangent(task.view, &ray, &met.hit, &met.surface.normals(), at.directed());
            let facing = |n: DVec3| if ray.direction.dot(met.surface.n_g) > 0.0 { -n } else { n };
            let n_g = facing(met.surface.n_g);
            let n_s = Some(facing(normal)).filter(|n| ray.direction.dot(*n) < 0.0).unwrap_or(n_g);
            let frame = tangent.map_or_else(|| Frame::about(n_s), |tangent| Frame::along(n_s, tangent));
            let wo = frame.to_local(-ray.direction);
            let bsdf = Bsdf::new(&at.parameters);
            let receiver = Receiver { point: met.point, normal: None, object: met.hit.instance, time: ray.time };
            if let Some(light) = lighting.sample(&receiver, wavelengths, u_light, [u_x, u_y])
                && let source = lighting.light(light.light)
                && (light.is_delta || source.is_some_and(|source| !source.has_natural_shadows()))
            {
                let wi = frame.to_local(light.wi);
                let f = bsdf.evaluate(wo, wi);
                let [diffuse, specular] = source.map_or([1.0; 2], |source| [source.diffuse, source.specular]);
                let value = diffuse as f32 * f.diffuse.hero() + specular as f32 * f.glossy.hero();
                let value = value * light.radiance.hero() / light.pdf;
                let lit = (wi.z > 0.0) == (light.wi.dot(n_g) > 0.0);
                if lit && value > 0.0 {
                    radiance += throughput * value * self.shadow(walk, &met, &light, wavelengths);
                }
            }
            let [u_lobe, u, v, u_roulette] = numbers.draw();
            let Some(sample) = bsdf.sample(wo, u_lobe, [u, v]) else { return (radiance, 1.0) };
            throughput *= sample.weight.hero();
            last = Some(LastEvent {
                receiver,
                diffuse_share: sample.diffuse.safe_div(sample.weight).hero(),
                is_smooth: !matches!(sample.scattered, Scattered::Toward(_)),
            });
            let (direction, passes) = match sample.scattered {
                Scattered::Toward(wi) => {
                    let direction = frame.to_world(wi);
                    let passes = direction.dot(n_g) < 0.0;
                    if passes != (wi.z < 0.0) {
                        return (radiance, 1.0);
                    }
                    (direction, passes)
                }
                Scattered::Mirror => {
                    let jet = medium.jet();
                    (mirror(jet.ior * ray.direction, &met.surface, &jet).momentum_out.normalize(), false)
                }
                Scattered::Refract => {
                    let (ior_i, ior_t) = (medium.jet(), far_medium.jet());
                    let scattering = refract_or_reflect(ior_i.ior * ray.direction, &met.surface, &ior_i, &ior_t);
                    (scattering.momentum_out.normalize(), scattering.kind == ScatterKind::Refraction)
                }
                Scattered::Straight => (ray.direction, true),
            };
            if passes && far.is_some() {
                let ratio = (far_medium.ior / medium.ior) as f32;
                squeezed *= ratio * ratio;
            }
            if vertices >= ROULETTE_FROM {
                let probability = (throughput * squeezed).min(0.95);
                if u_roulette >= probability {
                    return (radiance, 1.0);
                }
                throughput /= probability;
            }
            match (passes, far) {
                (true, Some(far)) => walk.pass(&met, far),
                (true, None) => walk.cross(&met),
                (false, _) => {}
            }
            walk.turn(&met, direction, passes);
        }
    }

    /// What is left of a sampled light in the shadow of the nearest thing in the way.
    fn shadow(&self, walk: &Walk<'_>, met: &SurfacePoint, light: &LightSample<1>, wavelengths: &Wavelengths<1>) -> f32 {
        let Prepared { task, lighting, .. } = self.prepared;
        let source = lighting.light(light.light);
        let mut departures = walk.departures;
        departures.depart(&walk.ray, &met.hit, light.wi.dot(met.surface.n_g) > 0.0);
        let mut ray = Ray { origin: met.point, direction: light.wi, ..walk.ray };
        let mut travelled = 0.0;
        while let Some(hit) = task.view.intersect(&ray, &departures) {
            travelled += hit.distance;
            if travelled >= light.distance * (1.0 - 1e-9) {
                return 1.0;
            }
            if source
                .and_then(|source| source.shadowed_by)
                .is_none_or(|set| task.view.scene.is_linked(set, hit.instance))
            {
                let Some(Light { shadow, .. }) = source else { return 0.0 };
                let strength = shadow.strength(travelled) as f32;
                let color = Reflectance::of_color(shadow.color.map(|channel| channel as f32));
                return 1.0 - strength * (1.0 - color.at(wavelengths).hero());
            }
            departures.depart(&ray, &hit, hit.leaving);
            ray.origin += hit.distance * ray.direction;
        }
        1.0
    }
}

/// The last event on a path.
struct LastEvent {
    receiver: Receiver,
    /// The part of its weight that is diffuse.
    diffuse_share: f32,
    /// Whether nothing but this way leads on.
    is_smooth: bool,
}

impl LastEvent {
    /// The share of a light met by chance that it receives: by its link set, by the light's factors, and nothing of light that
    /// was sampled there.
    fn receives(&self, lighting: &Lighting<'_>, direction: DVec3, met: &LightHit<1>) -> f32 {
        if !lighting.is_linked(met.light, self.receiver.object) {
            return 0.0;
        }
        let Some(light) = lighting.light(met.light) else { return 1.0 };
        let is_met = self.is_smooth || light.has_natural_shadows();
        if !is_met && lighting.pdf(&self.receiver, direction, met) > 0.0 {
            return 0.0;
        }
        light.diffuse as f32 * self.diffuse_share + light.specular as f32 * (1.0 - self.diffuse_share)
    }
}
