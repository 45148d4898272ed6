//! What can go wrong, one variant per family, each with the place concerned and the remedy.
//!
//! User input gives an [`Error`] whose text begins with the prim path, file or option concerned and ends with what to
//! do. Bugs are assertions. Oddities that do not stop a render are [`Diagnostics`](crate::diagnostics::Diagnostics).

use std::fmt;
use std::path::{Path, PathBuf};

/// The result of everything that depends on input.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An error that the caller can show as it is: one line, the place first, the remedy last.
#[derive(Debug)]
pub enum Error {
    /// A request that contradicts itself or names what does not exist: an unknown AOV, a zero resolution.
    Usage {
        /// The option or argument concerned.
        place: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// Scene content that cannot be used: broken topology, a glass with a pole inside the band.
    Scene {
        /// Prim path (with attribute) or scene file concerned.
        place: String,
        /// What is wrong, and what to do.
        problem: String,
    },
    /// A file that cannot be read, written or understood.
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        problem: String,
        /// The operating system's reason, if it gave one.
        source: Option<std::io::Error>,
    },
    /// The caller asked to stop.
    Interrupted,
}

impl Error {
    /// A usage error at `place`.
    pub fn usage(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Usage { place: place.into(), problem: problem.into() }
    }

    /// An error in the scene's content at `place`.
    pub fn scene(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Scene { place: place.into(), problem: problem.into() }
    }

    /// A file whose content cannot be used.
    pub fn file(path: impl AsRef<Path>, problem: impl Into<String>) -> Self {
        Self::File { path: path.as_ref().to_owned(), problem: problem.into(), source: None }
    }

    /// A file operation that the operating system refused.
    pub fn io(path: impl AsRef<Path>, doing: &str, source: std::io::Error) -> Self {
        Self::File {
            path: path.as_ref().to_owned(),
            problem: format!("cannot {doing}: {source}"),
            source: Some(source),
        }
    }

    /// The exit code of a command that ends with this error: 2 for usage, 130 for an interruption, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Usage { .. } => 2,
            Self::Interrupted => 130,
            Self::Scene { .. } | Self::File { .. } => 1,
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usage { place, problem } | Self::Scene { place, problem } => write!(f, "{place}: {problem}"),
            Self::File { path, problem, .. } => write!(f, "{}: {problem}", path.display()),
            Self::Interrupted => write!(f, "interrupted"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::File { source: Some(source), .. } => Some(source),
            _ => None,
        }
    }
}
