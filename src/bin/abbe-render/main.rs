//! `abbe-render`: renders exported scenes without Python or USD. The command line is in [`args`]; the work is the library's.
#![expect(clippy::print_stdout, clippy::print_stderr, reason = "a program talks to its user; the library does not")]

mod args;

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use abbe::diagnostics::Diagnostics;
use abbe::integrator::Registry;
use abbe::render::{self, Control, Plan, Progress};
use abbe::scene::{Scene, file};
use abbe::{Error, Result, exr};
use args::{Args, Command};
use serde_json::json;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

/// Exit code for output of which a part was written.
const PARTIAL: u8 = 3;

/// Set by Ctrl-C and SIGTERM.
struct Signals {
    stop: Arc<AtomicBool>,
    which: Arc<AtomicUsize>,
}

impl Signals {
    fn watch() -> std::io::Result<Self> {
        let signals = Self { stop: Arc::default(), which: Arc::default() };
        for signal in [SIGINT, SIGTERM] {
            // The number first, so that it is there when the render stops.
            flag::register_usize(signal, Arc::clone(&signals.which), signal as usize)?;
            flag::register(signal, Arc::clone(&signals.stop))?;
        }
        Ok(signals)
    }

    /// The exit code that shells give to a process ended by the signal.
    fn exit_code(&self) -> u8 {
        128 + self.which.load(Ordering::Relaxed) as u8
    }
}

fn main() -> ExitCode {
    let args = match args::parse(std::env::args_os().skip(1)) {
        Ok(Command::Render(args)) => args,
        Ok(Command::Print(text)) => {
            print!("{text}");
            return ExitCode::SUCCESS;
        }
        Err(error) => return fail(&error),
    };
    let signals = match Signals::watch() {
        Ok(signals) => signals,
        Err(error) => return fail(&Error::usage("signals", format!("cannot be watched: {error}"))),
    };
    let mut renders = Vec::new();
    let outcome = run(&args, &signals, &mut renders);
    let written = match &args.stats {
        Some(path) if !renders.is_empty() => write_statistics(path, &renders),
        _ => Ok(()),
    };
    match outcome.and(written) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Error::Interrupted) => {
            eprintln!("abbe: interrupted");
            ExitCode::from(signals.exit_code())
        }
        Err(error) if !renders.is_empty() && error.exit_code() == 1 => {
            fail(&error);
            ExitCode::from(PARTIAL)
        }
        Err(error) => fail(&error),
    }
}

fn fail(error: &Error) -> ExitCode {
    eprintln!("abbe: {error}");
    ExitCode::from(error.exit_code())
}

fn run(args: &Args, signals: &Signals, renders: &mut Vec<serde_json::Value>) -> Result<()> {
    let scene = Scene::build(file::read(&args.scene, args.mapped)?)?;
    let registry = Registry::default();
    if !args.quiet {
        warn(scene.diagnostics(), None);
    }
    let plans = render::plan(&scene, &args.request, &registry)?;
    let outputs = outputs(args, &plans)?;
    for (plan, output) in plans.iter().zip(&outputs) {
        let progress = Reporter::new(output, args.quiet);
        let control = Control { cancel: &signals.stop, progress: &|p| progress.report(p), pass: None };
        let rendered = render::render(&scene, plan, &registry, &control)?;
        progress.close();
        let statistics = &rendered.statistics;
        if !args.quiet {
            warn(&statistics.warnings, Some(scene.diagnostics()));
        }
        if statistics.complete || statistics.pixels > 0 {
            exr::write(output, &rendered.film, &rendered.metadata)?;
        }
        if !statistics.complete {
            if statistics.pixels > 0 {
                let (done, total) = (statistics.pixels, plan.window.area());
                eprintln!("abbe: {}: {done} of {total} pixels are finished, marked as partial", output.display());
            }
            return Err(Error::Interrupted);
        }
        let mut record = serde_json::to_value(statistics).expect("statistics have string keys");
        record["output"] = json!(output.display().to_string());
        renders.push(record);
    }
    Ok(())
}

/// The file of each plan: OUT, or what the products name.
fn outputs(args: &Args, plans: &[Plan]) -> Result<Vec<PathBuf>> {
    let outputs: Vec<PathBuf> = match &args.out {
        Some(out) if plans.len() > 1 => {
            let names: Vec<_> = plans.iter().map(|plan| plan.product.as_str()).collect();
            return Err(Error::usage(
                format!("OUT {}", out.display()),
                format!("the scene has {} products: choose one with --product: {}", plans.len(), names.join(", ")),
            ));
        }
        Some(out) => vec![out.clone()],
        None => plans.iter().map(|plan| PathBuf::from(&plan.output)).collect(),
    };
    for (index, output) in outputs.iter().enumerate() {
        if output.as_os_str().is_empty() {
            return Err(Error::usage(
                "OUT",
                "is missing, and the scene names no usable output: give a file such as out.exr",
            ));
        }
        let place = output.display().to_string();
        if output.extension().is_none_or(|suffix| !suffix.eq_ignore_ascii_case("exr")) {
            return Err(Error::usage(place, "must end with .exr"));
        }
        if outputs[..index].contains(output) {
            return Err(Error::usage(place, "several products would write it: choose one with --product"));
        }
        if output.is_dir() {
            return Err(Error::usage(place, "is a folder: name a file in it"));
        }
        let folder = folder_of(output);
        if !folder.is_dir() {
            return Err(Error::file(output, format!("the folder {} does not exist: create it", folder.display())));
        }
    }
    Ok(outputs)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Prints what was not told before.
fn warn(warnings: &Diagnostics, told: Option<&Diagnostics>) {
    for warning in warnings.warnings() {
        if told.is_none_or(|told| !told.warnings().contains(warning)) {
            eprintln!("abbe: warning: {warning}");
        }
    }
}

fn write_statistics(path: &Path, renders: &[serde_json::Value]) -> Result<()> {
    let document = json!({ "abbe": env!("CARGO_PKG_VERSION"), "renders": renders });
    let mut file = tempfile::Builder::new()
        .prefix(".abbe-")
        .suffix(".part")
        .tempfile_in(folder_of(path))
        .map_err(|e| Error::io(path, "create a file in its folder", e))?;
    serde_json::to_writer_pretty(&mut file, &document)
        .map_err(std::io::Error::from)
        .and_then(|()| file.write_all(b"\n"))
        .map_err(|e| Error::io(path, "write", e))?;
    file.persist(path).map_err(|e| Error::io(path, "move into place", e.error))?;
    Ok(())
}

/// Progress on stderr: a line that is rewritten on a terminal, a line now and then elsewhere.
struct Reporter {
    name: String,
    quiet: bool,
    is_terminal: bool,
    begin: Instant,
    /// When a line was shown last.
    last: Mutex<Instant>,
}

impl Reporter {
    fn new(output: &Path, quiet: bool) -> Self {
        let begin = Instant::now();
        let is_terminal = std::io::stderr().is_terminal();
        Self { name: output.display().to_string(), quiet, is_terminal, begin, last: Mutex::new(begin) }
    }

    fn report(&self, progress: Progress) {
        // A terminal bears ten lines a second, a log one in ten seconds.
        let every = if self.is_terminal { Duration::from_millis(100) } else { Duration::from_secs(10) };
        let Ok(mut last) = self.last.try_lock() else { return };
        if self.quiet || last.elapsed() < every {
            return;
        }
        *last = Instant::now();
        let fraction = progress.done as f64 / progress.total.max(1) as f64;
        let left = self.begin.elapsed().as_secs_f64() * (1.0 - fraction) / fraction;
        let left = left.round() as u64;
        let text = format!("{}: {:.0} %, {}:{:02} left", self.name, 100.0 * fraction, left / 60, left % 60);
        if self.is_terminal {
            eprint!("\r\x1b[K{text}");
        } else {
            eprintln!("abbe: {text}");
        }
    }

    fn close(&self) {
        if self.is_terminal && !self.quiet {
            eprint!("\r\x1b[K");
        }
    }
}
