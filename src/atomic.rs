//! Files that appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Calls `fill` with a temporary file in the target's directory, then renames it to `path`.
///
/// The data are on disk before the name is. An existing file is replaced in one step; a symbolic link is followed.
/// On an error nothing is left behind.
pub(crate) fn replace(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<()>) -> Result<()> {
    let target = checked_target(path)?;
    let directory = directory_of(&target).to_owned();
    let name = target.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{name}.");
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        // Temporary files are private by default; an output has the rights that the user's umask gives.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let temporary = builder.tempfile_in(&directory).map_err(|e| refused(path, &directory, e))?;
    let (file, temporary_path) = temporary.into_parts();
    let mut out = BufWriter::with_capacity(1 << 20, file);
    fill(&mut out)?;
    let file = out.into_inner().map_err(|e| refused(path, &directory, e.into_error()))?;
    file.sync_all().map_err(|e| refused(path, &directory, e))?;
    drop(file);
    temporary_path.persist(&target).map_err(|e| refused(path, &directory, e.error))?;
    // The rename itself reaches the disk with its directory. Not every file system lets one open or sync a directory,
    // and the file is complete under either name: no error.
    #[cfg(unix)]
    if let Ok(directory) = File::open(&directory) {
        let _ = directory.sync_all();
    }
    Ok(())
}

/// Where a file for `path` really goes; refuses what must not be replaced.
fn checked_target(path: &Path) -> Result<PathBuf> {
    if path.file_name().is_none() {
        return Err(Error::file(path, "this is no file name: name the file to write"));
    }
    match fs::metadata(path) {
        Ok(known) if known.is_dir() => Err(Error::file(path, "this is a directory: name a file in it")),
        Ok(known) if !known.is_file() => {
            Err(Error::file(path, "this is a device or pipe, which cannot be replaced in one step: name a plain file"))
        }
        Ok(known) if known.permissions().readonly() => {
            Err(Error::file(path, "the file is write-protected: permit writing it, or choose another name"))
        }
        Ok(_) => fs::canonicalize(path).map_err(|e| Error::io(path, "resolve the path", e)),
        Err(e) if e.kind() == ErrorKind::NotFound => match fs::read_link(path) {
            // A link to a file that is not there yet.
            Ok(link) => Ok(path.parent().unwrap_or(Path::new("")).join(link)),
            Err(_) => Ok(path.to_owned()),
        },
        Err(e) => Err(refused(path, directory_of(path), e)),
    }
}

/// The directory that `path` is in.
fn directory_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The error for a write that the system refused, with what to do about it.
fn refused(path: &Path, directory: &Path, source: io::Error) -> Error {
    let place = directory.display();
    let remedy = match source.kind() {
        ErrorKind::NotFound => format!("the directory {place} does not exist: create it, or choose another place"),
        ErrorKind::NotADirectory => format!("{place} is not a directory: choose another place"),
        ErrorKind::PermissionDenied => format!("no permission to write in {place}: permit it, or choose another place"),
        ErrorKind::ReadOnlyFilesystem => format!("{place} is on a read-only file system: choose another place"),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            format!("no space left in {place}: free some, or choose another place")
        }
        ErrorKind::FileTooLarge => {
            format!("the file is too large for the file system of {place}: choose another place")
        }
        ErrorKind::InvalidFilename => {
            "the system does not take this file name: choose a shorter or simpler one".to_owned()
        }
        _ => format!("the system refused it ({source}): check {place}, or choose another place"),
    };
    Error::File { path: path.to_owned(), problem: format!("cannot be written: {remedy}"), source: Some(source) }
}

/// Writes `bytes`, naming `path` in the error.
pub(crate) fn put(out: &mut impl Write, path: &Path, bytes: &[u8]) -> Result<()> {
    out.write_all(bytes).map_err(|e| refused(path, directory_of(path), e))
}
