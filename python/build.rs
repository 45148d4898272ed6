//! Hands the USD plug-in folder to maturin, which places it in the wheel as `abbe/plugin` (`pyproject.toml`, `include`).
//!
//! The folder's home is `plugin/` at the top of the repository, outside of the Python package; maturin follows no links, but
//! takes files from a build script's `OUT_DIR`.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let source = Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("../plugin");
    let target = PathBuf::from(env::var("OUT_DIR")?).join("plugin");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={}", source.display());
    // Files that were renamed or removed must not stay behind.
    if target.exists() {
        fs::remove_dir_all(&target)?;
    }
    copy(&source, &target).map_err(|e| format!("cannot copy the plug-in folder {}: {e}", source.display()))?;
    Ok(())
}
