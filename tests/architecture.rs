//! Imports go one way: a layer of the core knows only those below it (the table of `lib.rs`).

use std::fs;
use std::path::Path;

/// From the bottom up. `scene` has never heard of USD, `film` never of files, nobody of Python.
const LAYERS: &[&[&str]] = &[
    &["error", "diagnostics", "math"],
    &["atomic"],
    &["spectrum"],
    &["optics"],
    &["ray"],
    &["geometry"],
    &["bsdf", "light", "texture"],
    &["sampler"],
    &["scene", "camera"],
    &["lighting"],
    &["film"],
    &["integrator"],
    &["render", "exr"],
    &["compare"],
];

fn layer(module: &str) -> usize {
    LAYERS
        .iter()
        .position(|layer| layer.contains(&module))
        .unwrap_or_else(|| panic!("the module '{module}' stands in no layer: add it here and to lib.rs"))
}

fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn imports_go_down_the_layers() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut checked = 0;
    let mut wrong = Vec::new();
    for file in files {
        let relative = file.strip_prefix(&root).unwrap();
        let module = relative.components().next().unwrap().as_os_str().to_str().unwrap().trim_end_matches(".rs");
        if matches!(module, "lib" | "bin") {
            continue;
        }
        let own = layer(module);
        for (number, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
            if line.trim_start().starts_with("//") {
                continue;
            }
            for used in line.split("crate::").skip(1) {
                let used: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                // Re-exports of the crate's root (`crate::Result`) start with a capital.
                if used.is_empty() || used.starts_with(char::is_uppercase) {
                    continue;
                }
                checked += 1;
                if layer(&used) > own {
                    wrong.push(format!("{}:{}: {module} uses {used}", relative.display(), number + 1));
                }
            }
        }
    }
    assert!(checked > 50, "only {checked} imports were found: does this test still read them?");
    assert!(wrong.is_empty(), "imports that go up:\n{}", wrong.join("\n"));
}
