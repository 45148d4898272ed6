//! Writes `src/spectrum/reflectance.bin`: the spectra of a grid of colours, by the solver of [`abbe::spectrum::reflectance`].
//!
//! ```text
//! cargo run --release --example reflectance_table -- src/spectrum/reflectance.bin
//! ```

use abbe::spectrum::reflectance::{LEVELS, NODES, coefficients, level};

fn main() -> std::io::Result<()> {
    let Some(path) = std::env::args_os().nth(1) else {
        return Err(std::io::Error::other("name the file to write"));
    };
    let mut bytes = Vec::new();
    for largest in 0..3 {
        for k in 0..LEVELS {
            for j in 0..NODES {
                for i in 0..NODES {
                    let z = level(k);
                    let mut rgb = [z; 3];
                    rgb[(largest + 1) % 3] = z * (i as f64 / (NODES - 1) as f64);
                    rgb[(largest + 2) % 3] = z * (j as f64 / (NODES - 1) as f64);
                    // What rounding to f32 takes from steep curves is measured by the tests.
                    bytes.extend(coefficients(rgb).into_iter().flat_map(|c| (c as f32).to_le_bytes()));
                }
            }
        }
    }
    std::fs::write(path, bytes)
}
