//! A third party's integrator: registered by name, planned and rendered like our own.
//!
//! `cosine` tells how steeply the first surface is seen: the cosine between the view and the geometric normal, an AOV of
//! its own. Run it with a scene file that `abbe export` wrote:
//!
//! ```text
//! cargo run --release --example custom_integrator -- scene.safetensors cosine.exr
//! ```

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use abbe::error::{Error, Result};
use abbe::film::aov::{Aov, Family, Merge, SampleType};
use abbe::film::pixel::PixelAccumulator;
use abbe::integrator::chain::{Counters, Follower};
use abbe::integrator::{Integrator, PreparedIntegrator, Registry, Task, Worker};
use abbe::render::{Control, Request, plan, render};
use abbe::scene::{Scene, file};

static COSINE: Aov = Aov {
    name: "cosine",
    channels: &["X"],
    sample: SampleType::Float,
    unit: "1",
    merge: Merge::Mean,
    has_validity: true,
    family: Family::FirstSurface,
    doc: "cosine of the angle between the view and the geometric normal of the first surface",
};

struct Cosine;

impl Integrator for Cosine {
    fn name(&self) -> &str {
        "cosine"
    }

    fn summary(&self) -> &str {
        "how steeply the first surface is seen"
    }

    fn aovs(&self) -> Vec<&'static Aov> {
        vec![&COSINE]
    }

    fn prepare<'a>(&self, task: &'a Task<'a>) -> Result<Box<dyn PreparedIntegrator + 'a>> {
        Ok(Box::new(Prepared { task, follower: Follower::of_camera(task.view, task.camera) }))
    }
}

struct Prepared<'a> {
    task: &'a Task<'a>,
    follower: Follower<'a>,
}

impl PreparedIntegrator for Prepared<'_> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        Box::new(PerThread { prepared: self, counters: Counters::default() })
    }
}

struct PerThread<'a> {
    prepared: &'a Prepared<'a>,
    counters: Counters,
}

impl Worker for PerThread<'_> {
    fn render(&mut self, pixel: [i32; 2], range: Range<u32>, out: &mut PixelAccumulator) {
        let Prepared { task, follower } = self.prepared;
        for index in range {
            let start = task.camera.ray(&task.sampler.sample(pixel, index));
            let met = follower.first_surface(&start, &mut self.counters);
            out.add(0, met.map(|met| [start.direction.dot(met.surface.n_g).abs()]));
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

fn run() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(input), Some(output), None) = (arguments.next(), arguments.next(), arguments.next()) else {
        return Err(Error::usage("custom_integrator", "give a scene file and an output: SCENE.safetensors OUT.exr"));
    };
    let scene = Scene::build(file::read(Path::new(&input), false)?)?;
    let mut registry = Registry::default();
    registry.register(Arc::new(Cosine));
    let request =
        Request { integrator: Some("cosine".into()), aovs: Some(vec!["cosine".into()]), ..Request::default() };
    for plan in plan(&scene, &request, &registry)? {
        let rendered = render(&scene, &plan, &registry, &Control::none())?;
        abbe::exr::write(Path::new(&output), &rendered.film, &rendered.metadata)?;
    }
    Ok(())
}

fn main() -> std::process::ExitCode {
    match run() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            #[allow(clippy::print_stderr, reason = "a program tells its user what went wrong")]
            {
                eprintln!("{error}");
            }
            std::process::ExitCode::from(error.exit_code())
        }
    }
}
