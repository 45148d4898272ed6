//! `differentials`: no light transport. Follows the specular chain of each sample and fills the geometric and
//! differential AOVs.
//!
//! All derivatives are taken at the reference wavelength. Where no refraction of the chain has a dispersive medium they
//! are 0 and valid; on a miss those of position are absent; a chain without an end has none at all.

use std::ops::Range;

use glam::{DVec2, DVec3};

use super::chain::{Chain, Counters, End, Follower, Record, SurfacePoint};
use super::search::{EndKind, EndState, Wanted};
use super::transmittance::{Coefficients, Segment};
use super::{Columns, Integrator, PreparedIntegrator, Task, Worker, screen_motion};
use crate::error::{Error, Result};
use crate::film::aov::{AOVS, Aov, Family, INTERNAL_TRANSMITTANCE, MOTION};
use crate::film::pixel::PixelAccumulator;
use crate::ray::{
    ColumnSet, LambdaColumn, NoColumns, RayStart, ScreenColumns, SecondOrderColumns, Step, direction_derivative,
    direction_second_derivative, half_width, second_order_along,
};
use crate::sampler::CameraSample;
use crate::scene::material::{Kind, Material};
use crate::scene::view::{Media, View};

/// The integrator; it has no settings of its own.
#[derive(Clone, Copy, Debug)]
pub struct Differentials;

impl Integrator for Differentials {
    fn name(&self) -> &str {
        "differentials"
    }

    fn summary(&self) -> &str {
        "no light transport: follows the specular chain of each pixel and fills the geometric and differential AOVs"
    }

    fn aovs(&self) -> Vec<&'static Aov> {
        AOVS.iter().filter(|aov| aov.family != Family::Transport).collect()
    }

    fn prepare<'a>(&self, task: &'a Task<'a>) -> Result<Box<dyn PreparedIntegrator + 'a>> {
        Ok(Box::new(Prepared::new(task)?))
    }
}

/// One value of the table, resolved once per render.
#[derive(Clone, Copy, Debug)]
enum Output {
    DirectionByLambda,
    PositionByLambda,
    Footprint,
    HalfWidth,
    Motion,
    Motion2,
    Fetch(usize),
    SeenMotion,
    Ior,
    IorByLambda,
    AbbeNumber,
    InternalTransmittance,
    Interfaces,
    RoughInterfaces,
    TotalReflections,
    Surface(SurfaceValue, Whose),
    /// Another integrator's.
    Light,
}

#[derive(Clone, Copy, Debug)]
enum SurfaceValue {
    Depth,
    Position,
    Normal,
    NormalGeometric,
    Uv,
    Motion,
    Albedo,
    PrimId,
    InstanceId,
    MaterialId,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whose {
    First,
    Chain,
}

impl Output {
    fn of(aov: &Aov) -> Self {
        let (name, whose) = match aov.name.strip_prefix("refracted_") {
            Some(rest) => (rest, Whose::Chain),
            None => (aov.name, Whose::First),
        };
        let value = match name {
            "ddirection_dlambda" => return Self::DirectionByLambda,
            "dposition_dlambda" => return Self::PositionByLambda,
            "dispersion_footprint" => return Self::Footprint,
            "footprint_half_width" => return Self::HalfWidth,
            "dispersion" => return Self::Motion,
            "dispersion2" => return Self::Motion2,
            "dispersion_r" => return Self::Fetch(0),
            "dispersion_g" => return Self::Fetch(1),
            "dispersion_b" => return Self::Fetch(2),
            "ior" => return Self::Ior,
            "dior_dlambda" => return Self::IorByLambda,
            "abbe_number" => return Self::AbbeNumber,
            INTERNAL_TRANSMITTANCE => return Self::InternalTransmittance,
            "interfaces" => return Self::Interfaces,
            "rough_interfaces" => return Self::RoughInterfaces,
            "total_reflections" => return Self::TotalReflections,
            "depth" => SurfaceValue::Depth,
            "position" => SurfaceValue::Position,
            "normal" => SurfaceValue::Normal,
            "normal_geometric" => SurfaceValue::NormalGeometric,
            "uv" => SurfaceValue::Uv,
            MOTION if whose == Whose::First => SurfaceValue::Motion,
            MOTION => return Self::SeenMotion,
            "albedo" => SurfaceValue::Albedo,
            "prim_id" => SurfaceValue::PrimId,
            "instance_id" => SurfaceValue::InstanceId,
            "material_id" => SurfaceValue::MaterialId,
            _ if aov.family == Family::Transport => return Self::Light,
            other => unreachable!("the AOV '{other}' is in the table but not in this integrator"),
        };
        Self::Surface(value, whose)
    }
}

/// `differentials` made ready for one image.
pub(super) struct Prepared<'a> {
    task: &'a Task<'a>,
    follower: Follower<'a>,
    media: Media,
    /// At the wavelengths of the R, G, B responses; empty unless a layer asks for it.
    channel_media: Vec<Media>,
    outputs: Vec<Output>,
    /// Of every medium at the wavelengths of the R, G, B responses; `None` unless a layer asks for it.
    absorption: Option<Coefficients<3>>,
    /// Of every material; empty unless a layer asks for it.
    abbe_numbers: Vec<Option<f64>>,
    /// Whether some layer tells about the first surface.
    needs_first: bool,
}

impl<'a> Prepared<'a> {
    fn new(task: &'a Task<'a>) -> Result<Self> {
        let scene = task.view.scene;
        let media = |wavelength| Media::at(scene, wavelength, task.optics.dispersion_scale);
        let abbe_number = |material: &Material| match &material.kind {
            Kind::Dielectric { dispersion, .. } => {
                let scaled = dispersion.scaled(task.optics.dispersion_scale);
                Ok(scaled.map_err(|problem| Error::scene(&material.path, problem))?.abbe_number())
            }
            _ => Ok(None),
        };
        let has_abbe_number = task.aovs.iter().any(|aov| aov.name == "abbe_number");
        let asked = if has_abbe_number { scene.materials.as_slice() } else { &[] };
        let channels: &[_] = if task.needs.retrace { &task.optics.channels } else { &[] };
        Ok(Self {
            task,
            follower: Follower::of_camera(task.view, task.camera),
            media: media(task.optics.reference)?,
            channel_media: channels.iter().map(|&wavelength| media(wavelength)).collect::<Result<_>>()?,
            outputs: task.aovs.iter().map(|aov| Output::of(aov)).collect(),
            absorption: task.needs.transmittance.then(|| Coefficients::at(scene, task.optics.channels)),
            abbe_numbers: asked.iter().map(abbe_number).collect::<Result<_>>()?,
            needs_first: task.aovs.iter().any(|aov| aov.family == Family::FirstSurface),
        })
    }
}

/// Adds the geometric and differential layers of one sample: what other integrators do beside their own.
pub(super) trait SampleWorker {
    /// Adds the sample at `place` to every such layer.
    fn sample(&mut self, place: &CameraSample, out: &mut PixelAccumulator);
    /// What it has done so far.
    fn counters(&self) -> Counters;
}

impl Differentials {
    /// Made ready beside another integrator, whose layers are left alone.
    pub(super) fn prepared<'a>(task: &'a Task<'a>) -> Result<Prepared<'a>> {
        Prepared::new(task)
    }
}

impl Prepared<'_> {
    /// A worker for one thread.
    pub(super) fn sample_worker(&self) -> Box<dyn SampleWorker + '_> {
        match self.task.needs.columns {
            Columns::None => Box::new(Carrier::<NoColumns>::new(self)),
            Columns::Lambda => Box::new(Carrier::<LambdaColumn>::new(self)),
            Columns::Screen => Box::new(Carrier::<ScreenColumns>::new(self)),
            Columns::SecondOrder => Box::new(Carrier::<SecondOrderColumns>::new(self)),
        }
    }
}

impl PreparedIntegrator for Prepared<'_> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        match self.task.needs.columns {
            Columns::None => Box::new(Carrier::<NoColumns>::new(self)),
            Columns::Lambda => Box::new(Carrier::<LambdaColumn>::new(self)),
            Columns::Screen => Box::new(Carrier::<ScreenColumns>::new(self)),
            Columns::SecondOrder => Box::new(Carrier::<SecondOrderColumns>::new(self)),
        }
    }
}

/// A worker that carries the columns `C`.
struct Carrier<'a, C> {
    prepared: &'a Prepared<'a>,
    counters: Counters,
    log: Vec<Step>,
    segments: Vec<Segment>,
    columns: std::marker::PhantomData<C>,
}

impl<C: ColumnSet> Worker for Carrier<'_, C> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        let task = self.prepared.task;
        for index in range {
            self.add_sample(&task.sampler.sample(pixel, index), out);
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

impl<C: ColumnSet> SampleWorker for Carrier<'_, C> {
    fn sample(&mut self, place: &CameraSample, out: &mut PixelAccumulator) {
        self.add_sample(place, out);
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

impl<'a, C: ColumnSet> Carrier<'a, C> {
    fn new(prepared: &'a Prepared<'a>) -> Self {
        Self {
            prepared,
            counters: Counters::default(),
            log: Vec::new(),
            segments: Vec::new(),
            columns: std::marker::PhantomData,
        }
    }

    fn add_sample(&mut self, place: &CameraSample, out: &mut PixelAccumulator) {
        let Prepared { task, follower, media, .. } = self.prepared;
        let start = task.camera.ray(place);
        if !task.needs.chain {
            let first = follower.first_surface(&start, &mut self.counters);
            for (layer, &output) in self.prepared.outputs.iter().enumerate() {
                if let Output::Surface(value, _) = output {
                    self.surface_value(value, layer, &start, first.as_ref(), out);
                }
            }
            return;
        }
        let record = Record {
            steps: task.needs.second_chain.then_some(&mut self.log),
            segments: task.needs.transmittance.then_some(&mut self.segments),
        };
        let chain = follower.follow::<C>(&start, media, record, &mut self.counters);
        let sample = Sample { task, chain: &chain, end: EndState::new(&chain) };
        let end_surface = match &chain.end {
            End::Surface(point) => Some(point),
            End::Miss | End::Exhausted => None,
        };
        let first = if self.prepared.needs_first { chain.first.as_ref() } else { None };
        // The first dielectric entered.
        let dielectric = (chain.dielectric_id > 0).then(|| media.of_material(chain.dielectric_id));
        for (layer, &output) in self.prepared.outputs.iter().enumerate() {
            match output {
                Output::DirectionByLambda => out.add(layer, sample.direction_by_lambda()),
                Output::PositionByLambda => out.add(layer, sample.position_by_lambda()),
                Output::Footprint => out.add(layer, scalar(sample.footprint())),
                Output::HalfWidth => out.add(layer, scalar(sample.half_width())),
                Output::Motion => out.add(layer, sample.visible_motion()),
                Output::Motion2 => {
                    let motion2 = sample.motion2(&start, &self.log, &mut self.counters);
                    out.add(layer, motion2);
                }
                Output::Fetch(channel) => {
                    let offset = self.fetch_offset(place, &start, &sample, channel);
                    out.add(layer, offset);
                }
                Output::SeenMotion => {
                    let motion =
                        screen_motion::of_end(task, follower, media, place, &start, &chain, &mut self.counters);
                    out.add(layer, motion);
                }
                Output::Ior => {
                    let ior = dielectric.map(|jet| jet.ior);
                    out.add(layer, scalar(ior));
                }
                Output::IorByLambda => {
                    let dior = dielectric.map(|jet| jet.dior_dlambda);
                    out.add(layer, scalar(dior));
                }
                Output::AbbeNumber => {
                    let material = (chain.dielectric_id as usize).checked_sub(1);
                    out.add(layer, scalar(material.and_then(|i| self.prepared.abbe_numbers[i])));
                }
                Output::InternalTransmittance => {
                    // Nothing is looked up where no medium absorbs.
                    let transmittance = |absorption: &Coefficients<3>| absorption.transmittance(&self.segments);
                    let value = self.prepared.absorption.as_ref().map_or([1.0; 3], transmittance);
                    out.add(layer, sample.end.exists().then_some(value));
                }
                Output::Interfaces => out.add_first(layer, chain.interfaces),
                Output::RoughInterfaces => out.add_first(layer, chain.rough_interfaces),
                Output::Light => {}
                Output::TotalReflections => out.add_first(layer, chain.total_reflections),
                Output::Surface(value, Whose::First) => self.surface_value(value, layer, &start, first, out),
                Output::Surface(value, Whose::Chain) => {
                    self.surface_value(
                        value,
                        layer,
                        &RayStart { direction: chain.direction, ..start },
                        end_surface,
                        out,
                    );
                }
            }
        }
    }

    /// Adds one value of the surface `met`, which a ray reached along `arriving.direction`.
    fn surface_value(
        &mut self,
        value: SurfaceValue,
        layer: usize,
        arriving: &RayStart,
        met: Option<&SurfacePoint>,
        out: &mut PixelAccumulator,
    ) {
        let task = self.prepared.task;
        let view: &View<'_> = task.view;
        let object = met.map(|met| view.scene.objects.ids(met.hit.instance));
        match value {
            SurfaceValue::Depth => out.add(layer, scalar(met.map(|met| task.camera.depth(met.point, arriving.time)))),
            SurfaceValue::Position => out.add(layer, met.map(|met| view.origin + met.point)),
            SurfaceValue::Normal => {
                let facing = |met: &SurfacePoint| {
                    let n_s = met.surface.n_s;
                    if arriving.direction.dot(met.surface.n_g) > 0.0 { -n_s } else { n_s }
                };
                out.add(layer, met.map(facing));
            }
            SurfaceValue::NormalGeometric => out.add(layer, met.map(|met| met.surface.n_g)),
            SurfaceValue::Uv => {
                self.counters.uv_lookups += u64::from(met.is_some());
                let uv = met.and_then(|met| view.aggregate.uv(&met.hit, met.point));
                out.add(layer, uv);
            }
            SurfaceValue::Motion => out.add(layer, screen_motion::of_surface(task, arriving, met)),
            SurfaceValue::Albedo => {
                self.counters.albedo_lookups += u64::from(met.is_some());
                out.add(layer, met.map(|met| view.albedo(&met.hit, met.material_id)));
            }
            SurfaceValue::PrimId => out.add_first(layer, object.map_or(0, |o| o.prim_id)),
            SurfaceValue::InstanceId => out.add_first(layer, object.map_or(0, |o| o.instance_id)),
            SurfaceValue::MaterialId => out.add_first(layer, met.map_or(0, |met| met.material_id)),
        }
    }

    /// Exact displacement at a channel's wavelength as a fetch offset: what is seen at `place` there, is seen at
    /// `place` + offset at the reference wavelength. Started from the first-order motion.
    fn fetch_offset(
        &mut self,
        place: &CameraSample,
        start: &RayStart,
        sample: &Sample<'_, C>,
        channel: usize,
    ) -> Option<DVec2> {
        let Prepared { task, follower, media, channel_media, .. } = self.prepared;
        if !sample.chain.is_dispersive {
            return sample.end.exists().then_some(DVec2::ZERO);
        }
        self.counters.retraces += 1;
        let target = follower.follow::<NoColumns>(start, &channel_media[channel], Record::none(), &mut self.counters);
        let delta = task.optics.channels[channel].nanometers() - task.optics.reference.nanometers();
        let offset = sample.motion().map_or(DVec2::ZERO, |motion| -motion * delta);
        let wanted = Wanted::of(&target);
        wanted.find(offset, &mut self.counters, |offset, counters| {
            let moved = task.camera.ray_at(&place.moved(offset.x, -offset.y), start.time);
            follower.follow(&moved, media, Record::none(), counters)
        })
    }
}

fn scalar(value: Option<f64>) -> Option<[f64; 1]> {
    value.map(|v| [v])
}

/// One followed chain with what can be said of its derivatives.
struct Sample<'a, C> {
    task: &'a Task<'a>,
    chain: &'a Chain<C>,
    end: EndState,
}

impl<C: ColumnSet> Sample<'_, C> {
    fn direction_by_lambda(&self) -> Option<DVec3> {
        let chain = self.chain;
        if !self.end.exists() {
            return None;
        }
        match chain.columns.lambda() {
            Some(col_lambda) if chain.is_dispersive => Some(direction_derivative(
                col_lambda.momentum,
                chain.direction,
                chain.medium.ior,
                chain.medium.dior_dlambda,
            )),
            _ => Some(DVec3::ZERO),
        }
    }

    fn position_by_lambda(&self) -> Option<DVec3> {
        if self.end.kind != EndKind::Surface {
            return None;
        }
        match self.chain.columns.lambda() {
            Some(col_lambda) if self.chain.is_dispersive => Some(col_lambda.point),
            _ => Some(DVec3::ZERO),
        }
    }

    fn footprint(&self) -> Option<f64> {
        self.position_by_lambda().map(|p_lambda| p_lambda.length() * self.task.optics.band_width())
    }

    fn half_width(&self) -> Option<f64> {
        let half_band = 0.5 * self.task.optics.band_width();
        if !self.end.exists() {
            return None;
        }
        let (Some(col_lambda), Some(lambda2), true) =
            (self.chain.columns.lambda(), self.chain.columns.lambda2(), self.chain.is_dispersive)
        else {
            return Some(half_band);
        };
        let (first, second) = if self.end.kind == EndKind::Surface {
            (col_lambda.point, lambda2.point)
        } else {
            // Infinitely far away the footprint is one of directions.
            let first = self.direction_by_lambda()?;
            let medium = &self.chain.medium;
            (first, direction_second_derivative(lambda2.momentum, self.chain.direction, first, medium))
        };
        Some(half_width(first, second, half_band, self.chain.nearest_critical))
    }

    /// Motion on screen per nanometre, however large.
    fn motion(&self) -> Option<DVec2> {
        if !self.end.exists() {
            return None;
        }
        if !self.chain.is_dispersive {
            return Some(DVec2::ZERO);
        }
        let [v_x, v_y] = self.end.screen_columns(self.chain)?;
        let v_lambda = if self.end.kind == EndKind::Surface {
            self.chain.columns.lambda()?.point
        } else {
            self.direction_by_lambda()?
        };
        crate::ray::screen_motion(v_x, v_y, v_lambda, self.end.normal)
    }

    /// Absent where 1 nm moves more than the image's diagonal: a caustic as seen from the eye.
    fn visible_motion(&self) -> Option<DVec2> {
        let [width, height] = self.task.resolution.map(f64::from);
        self.motion().filter(|motion| motion.length_squared() <= width * width + height * height)
    }

    fn motion2(&self, start: &RayStart, log: &[Step], counters: &mut Counters) -> Option<DVec2> {
        let motion = self.visible_motion()?;
        if !self.chain.is_dispersive {
            return Some(DVec2::ZERO);
        }
        counters.second_chains += 1;
        let along = second_order_along(start, &self.chain.start_medium, motion.extend(1.0), log);
        let [v_x, v_y] = self.end.screen_columns(self.chain)?;
        let second = if self.end.kind == EndKind::Surface {
            along.point2
        } else {
            let medium = &self.chain.medium;
            let first = direction_derivative(along.momentum, self.chain.direction, medium.ior, medium.dior_dlambda);
            direction_second_derivative(along.momentum2, self.chain.direction, first, medium)
        };
        crate::ray::screen_motion(v_x, v_y, second, self.end.normal)
    }
}
