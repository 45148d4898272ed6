//! `Scene`: a checked scene that Python loads once and renders often.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::time::Duration;

use abbe::Error;
use abbe::film::Film;
use abbe::film::metadata::Metadata;
use abbe::integrator::Registry;
use abbe::render::{self, Control, Plan, Progress, Rendered, Request};
use abbe::scene::description::Description;
use abbe::scene::lights::Summary;
use abbe::scene::{Scene, file};
use numpy::PyUntypedArray;
use pyo3::prelude::*;

use crate::error::{Failure, Outcome, defect, released};
use crate::film::PyFilm;
use crate::json;
use crate::memory::array_from_numpy;

/// How often a render looks for signals and calls the progress callback: often enough for Ctrl-C to feel immediate.
const POLL: Duration = Duration::from_millis(100);

/// A checked scene. Nothing changes it, so it renders from several threads at once.
#[pyclass(name = "Scene", module = "abbe._core", frozen)]
pub(crate) struct PyScene {
    scene: Scene,
    registry: Registry,
}

impl PyScene {
    fn build(description: Description) -> Outcome<Self> {
        Ok(Self { scene: Scene::build(description)?, registry: Registry::default() })
    }

    fn plans(&self, request: &str) -> Outcome<Vec<Plan>> {
        let request: Request = json::parse("request", request)?;
        Ok(render::plan(&self.scene, &request, &self.registry)?)
    }

    fn plan_at(&self, request: &str, index: usize) -> Outcome<Plan> {
        let mut plans = self.plans(request)?;
        if index >= plans.len() {
            let problem = format!("there is no plan {index}: this request has {}", plans.len());
            return Err(Error::usage("plan", problem).into());
        }
        Ok(plans.swap_remove(index))
    }
}

#[pymethods]
impl PyScene {
    /// Builds a scene from a document and its arrays; read-only arrays are shared, others copied.
    #[new]
    fn new(py: Python<'_>, document: &str, arrays: BTreeMap<String, Bound<'_, PyUntypedArray>>) -> Outcome<Self> {
        let arrays = arrays
            .iter()
            .map(|(name, array)| Ok((name.clone(), array_from_numpy(name, array)?)))
            .collect::<PyResult<_>>()?;
        released(py, || Self::build(Description::from_json(document, arrays, "scene description")?))
    }

    /// Reads a scene file, or maps it into memory (it must then not change while the scene is in use).
    #[staticmethod]
    #[pyo3(signature = (path, *, mapped = false))]
    fn load(py: Python<'_>, path: PathBuf, mapped: bool) -> Outcome<Self> {
        released(py, || Self::build(file::read(&path, mapped)?))
    }

    /// Writes the scene as a file, complete or not at all; `embed` puts what is in its image files into it.
    #[pyo3(signature = (path, *, embed = false))]
    fn save(&self, py: Python<'_>, path: PathBuf, embed: bool) -> Outcome<()> {
        released(py, || {
            let description = self.scene.description();
            if embed {
                file::write(&path, &file::embedded(description))?;
            } else {
                file::write(&path, description)?;
            }
            Ok(())
        })
    }

    /// The scene description's document, as JSON.
    fn document(&self) -> String {
        serde_json::to_string(self.scene.document()).expect("the document has string keys")
    }

    /// Warnings of the bridge and of the checks: dicts with kind, message, places and count.
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, self.scene.diagnostics())
    }

    /// Time of building the trees over triangles, seconds, summed over shapes.
    fn tree_seconds(&self) -> f64 {
        self.scene.tree_seconds
    }

    /// What would be rendered, one (text, JSON) per product.
    fn plan(&self, py: Python<'_>, request: &str) -> Outcome<Vec<(String, String)>> {
        released(py, || {
            let as_pair = |plan: &Plan| {
                (plan.to_string(), serde_json::to_string(plan).expect("the plan has string keys and finite numbers"))
            };
            Ok(self.plans(request)?.iter().map(as_pair).collect())
        })
    }

    /// The lights as integrators that use them have them, and what was odd about them: (lights, warnings).
    fn lights<'py>(&self, py: Python<'py>) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (lights, summaries) = released(py, || {
            let lights = self.scene.lights()?;
            let summaries = Summary::all(&self.scene, &lights);
            Ok((lights, summaries))
        })?;
        Ok((json::to_python(py, &summaries)?, json::to_python(py, &lights.diagnostics)?))
    }

    /// Every event of one sample's chain, with its columns.
    #[pyo3(signature = (request, plan_index, pixel, sample = 0))]
    fn trace<'py>(
        &self,
        py: Python<'py>,
        request: &str,
        plan_index: usize,
        pixel: (i32, i32),
        sample: u32,
    ) -> Outcome<Bound<'py, PyAny>> {
        let events = released(py, || {
            let plan = self.plan_at(request, plan_index)?;
            Ok(render::trace(&self.scene, &plan, [pixel.0, pixel.1], sample)?)
        })?;
        Ok(json::to_python(py, &events)?)
    }

    /// Ways to get a derivative, measured on one plan's chains in `rounds` rounds.
    #[pyo3(signature = (request, plan_index = 0, rounds = 5))]
    fn compare<'py>(
        &self,
        py: Python<'py>,
        request: &str,
        plan_index: usize,
        rounds: usize,
    ) -> Outcome<Bound<'py, PyAny>> {
        let comparison = released(py, || {
            let plan = self.plan_at(request, plan_index)?;
            Ok(abbe::compare::compare(&self.scene, &plan, rounds)?)
        })?;
        Ok(json::to_python(py, &comparison)?)
    }

    /// Renders one plan with the interpreter released.
    ///
    /// About ten times a second the calling thread looks for signals and calls ``progress(done, total)`` (pixels). If either
    /// raises, the render stops and the exception goes on to the caller with what was finished as its attribute ``film``.
    /// With ``passed`` the render grows: it is called with the film of 1, 2, 4 … samples while the render waits.
    #[pyo3(signature = (request, plan_index = 0, progress = None, passed = None))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        request: &str,
        plan_index: usize,
        progress: Option<Py<PyAny>>,
        passed: Option<Py<PyAny>>,
    ) -> Outcome<Bound<'py, PyFilm>> {
        let plan = released(py, || self.plan_at(request, plan_index))?;
        let total = plan.window.area() as u64;
        let cancel = AtomicBool::new(false);
        let done = AtomicU64::new(0);
        let ask = |py: Python<'_>| -> PyResult<()> {
            py.check_signals()?;
            match &progress {
                Some(callback) => callback.call1(py, (done.load(Ordering::Relaxed), total)).map(drop),
                None => Ok(()),
            }
        };
        let show = |py: Python<'_>, film: Film, metadata: Metadata| -> PyResult<()> {
            let Some(callback) = &passed else { return Ok(()) };
            let statistics = serde_json::json!({
                "complete": true,
                "pixels": film.window.area(),
                "samples": film.samples.end - film.samples.begin,
                "warnings": [],
            });
            callback.call1(py, (PyFilm::new(film, metadata, statistics),)).map(drop)
        };
        let show: Option<&Show<'_>> = if passed.is_some() { Some(&show) } else { None };
        let (rendered, raised) = py.detach(|| watch(&self.scene, &plan, &self.registry, &cancel, &done, &ask, show));
        let rendered = rendered?;
        let statistics = serde_json::to_value(&rendered.statistics).expect("statistics have string keys");
        let film = Bound::new(py, PyFilm::new(rendered.film, rendered.metadata, statistics))?;
        match raised {
            None => Ok(film),
            Some(error) => {
                // Not every exception takes attributes; then only what was rendered is lost, not the exception.
                let _ = error.value(py).setattr("film", film);
                Err(error.into())
            }
        }
    }
}

/// Shows the film of a pass.
type Show<'a> = dyn Fn(Python<'_>, Film, Metadata) -> PyResult<()> + Sync + 'a;

/// What the rendering thread says.
enum Message {
    /// A pass has ended; the thread waits for an answer.
    Passed(Box<(Film, Metadata)>),
    Ended(Box<Outcome<Rendered>>),
}

/// Renders on a thread of its own while this one asks (with the interpreter) whether to go on.
///
/// Returns what was rendered, and the exception that stopped it.
fn watch(
    scene: &Scene,
    plan: &Plan,
    registry: &Registry,
    cancel: &AtomicBool,
    done: &AtomicU64,
    ask: &(dyn Fn(Python<'_>) -> PyResult<()> + Sync),
    show: Option<&Show<'_>>,
) -> (Outcome<Rendered>, Option<PyErr>) {
    let note = |progress: Progress| {
        done.fetch_max(progress.done, Ordering::Relaxed);
    };
    std::thread::scope(|threads| {
        let (send, receive) = sync_channel(1);
        let (answer, answers) = sync_channel::<bool>(1);
        let answers = Mutex::new(answers);
        threads.spawn(move || {
            let pass = |film, metadata| {
                let said = send.send(Message::Passed(Box::new((film, metadata))));
                said.is_ok() && answers.lock().is_ok_and(|answers| answers.recv() == Ok(true))
            };
            let pass: &(dyn Fn(Film, Metadata) -> bool + Sync) = &pass;
            let control = Control { cancel, progress: &note, pass: show.is_some().then_some(pass) };
            let work = AssertUnwindSafe(|| render::render(scene, plan, registry, &control));
            let outcome = match catch_unwind(work) {
                Ok(outcome) => outcome.map_err(Failure::from),
                Err(panic) => Err(defect(panic.as_ref())),
            };
            // The other end waits until this arrives.
            let _ = send.send(Message::Ended(Box::new(outcome)));
        });
        let mut raised = None;
        let outcome = loop {
            match receive.recv_timeout(POLL) {
                Ok(Message::Ended(outcome)) => break *outcome,
                Ok(Message::Passed(pass)) => {
                    let (film, metadata) = *pass;
                    let shown = Python::attach(|py| {
                        ask(py)?;
                        show.map_or(Ok(()), |show| show(py, film, metadata))
                    });
                    let goes_on = shown.is_ok();
                    if let Err(error) = shown {
                        cancel.store(true, Ordering::Relaxed);
                        raised = Some(error);
                    }
                    // The thread waits for this; if it has ended, that arrives next.
                    let _ = answer.send(goes_on);
                }
                Err(RecvTimeoutError::Disconnected) => break Err(Failure::Defect("the render thread ended".into())),
                Err(RecvTimeoutError::Timeout) if raised.is_some() => {}
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(error) = Python::attach(ask) {
                        cancel.store(true, Ordering::Relaxed);
                        raised = Some(error);
                    }
                }
            }
        };
        // A last word, so that a callback sees the end and a signal of the last moment is not lost.
        if raised.is_none() && outcome.is_ok() {
            raised = Python::attach(ask).err();
        }
        (outcome, raised)
    })
}
