//! Photometric profiles: files of IES LM-63 (1986, 1991, 1995, 2002, 2019), parsed and evaluated.
//!
//! A profile is a table of luminous intensities over two angles, in one of three coordinate systems (IES LM-75):
//! type C counts the vertical angle from the nadir and the horizontal one around it; types A and B are latitude and
//! longitude about a vertical and a horizontal pole. Here the luminaire hangs in a light of UsdLux: the nadir of type C and the
//! photometric axis of types A and B point along the light's −z. Around it, horizontal angles of type C start at the
//! light's −x and turn towards −y, as hdEmbree of OpenUSD has it; of types A and B, "up" is +y and "right" is +x.
//!
//! Symmetries are unfolded when a file is read. Between the angles intensities are linear in both; outside of the vertical
//! range there is no light. The lamp's tilt factors are skipped, as everybody does: they need the luminaire's pose.
//! Files come from anywhere: numbers are checked, sizes are bounded, and what is wrong is said in one line.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// Files larger than this are refused: the largest in use have a few hundred kB.
pub const MAX_BYTES: usize = 16 << 20;
/// More intensities than this are refused, symmetries unfolded: as many as fit such a file.
const MAX_VALUES: usize = 1 << 22;
/// Angles this close are the same, degrees: files round them to a few digits.
const SAME: f64 = 1e-3;

/// A photometric profile.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    system: System,
    /// Angles to one pole, radians, increasing.
    polar: Vec<f64>,
    /// Angles around it, radians, increasing.
    azimuth: Vec<f64>,
    /// Candela, azimuth by azimuth.
    intensities: Vec<f64>,
}

/// How the angles count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum System {
    /// Polar angle from the nadir, −z; azimuth about it in 0..=2π.
    C,
    /// Polar angle from the bottom, −y; azimuth in −π..=π from −z towards +x.
    A,
    /// Polar angle from the left, −x; azimuth in −π..=π from −z towards +y.
    B,
}

impl Profile {
    /// Reads the text of a file; says what is wrong with one that is no profile.
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() > MAX_BYTES {
            return Err(format!("has {} bytes: no profile is that large", bytes.len()));
        }
        // Old files are in code pages; only the numbers matter.
        let text = String::from_utf8_lossy(bytes);
        let (tilt, rest) = after_tilt(&text).ok_or("has no TILT= line: it is no IES LM-63 file")?;
        let mut numbers = Numbers(rest);
        if tilt.eq_ignore_ascii_case("INCLUDE") {
            numbers.next("lamp-to-luminaire geometry")?;
            let angles = numbers.count("number of tilt angles")?;
            for _ in 0..2 * angles {
                numbers.next("tilt angles and factors")?;
            }
        }
        numbers.next("number of lamps")?;
        numbers.next("lumens per lamp")?;
        let mut factor = numbers.next("candela multiplier")?;
        let vertical_count = numbers.count("number of vertical angles")?;
        let horizontal_count = numbers.count("number of horizontal angles")?;
        let system = match numbers.count("photometric type")? {
            1 => System::C,
            2 => System::B,
            3 => System::A,
            other => return Err(format!("has the photometric type {other}: there are 1 (C), 2 (B) and 3 (A)")),
        };
        for what in ["units", "width", "length", "height"] {
            numbers.next(what)?;
        }
        factor *= numbers.next("ballast factor")?;
        // Since 1995 this is "future use", and 1.
        factor *= numbers.next("ballast-lamp photometric factor")?;
        numbers.next("input watts")?;
        if !(factor >= 0.0 && factor.is_finite()) {
            return Err(format!("multiplies its intensities by {factor}: such light there is not"));
        }
        if vertical_count < 2 || horizontal_count < 1 {
            return Err(format!(
                "has {vertical_count} vertical and {horizontal_count} horizontal angles: two and one are the least"
            ));
        }
        if vertical_count.saturating_mul(horizontal_count) > MAX_VALUES {
            return Err(format!("has {vertical_count} by {horizontal_count} intensities: no profile has that many"));
        }
        let vertical = numbers.angles("vertical angles", vertical_count)?;
        let horizontal = numbers.angles("horizontal angles", horizontal_count)?;
        // Grows with what is read, so that a file that only claims to be large takes no memory.
        let mut intensities = Vec::new();
        for _ in 0..vertical_count * horizontal_count {
            // Fits and measurements leave slightly negative ones behind.
            let candela = factor * numbers.next("intensities")?.max(0.0);
            if !candela.is_finite() {
                return Err("has an intensity beyond all numbers".into());
            }
            intensities.push(candela);
        }
        Self::unfold(system, &vertical, &horizontal, intensities)
    }

    /// From what the file has, in degrees, to the whole.
    fn unfold(system: System, vertical: &[f64], horizontal: &[f64], intensities: Vec<f64>) -> Result<Self, String> {
        let (low, high) = match system {
            System::C => (0.0, 180.0),
            System::A | System::B => (-90.0, 90.0),
        };
        let ends = |angles: &[f64]| (angles[0], angles[angles.len() - 1]);
        let (first, last) = ends(vertical);
        if first < low - SAME || last > high + SAME {
            return Err(format!("has vertical angles from {first} to {last}: its type has {low} to {high}"));
        }
        // (angle, column of the file) around the pole.
        let (first, last) = ends(horizontal);
        let mut columns: Vec<(f64, usize)> = horizontal.iter().copied().zip(0..).collect();
        let same = |a: f64, b: f64| (a - b).abs() < SAME;
        // What stands before `about` once more behind it.
        let mirror = |columns: &mut Vec<(f64, usize)>, about: f64| {
            let mirrored: Vec<_> = columns.iter().rev().map(|&(angle, column)| (2.0 * about - angle, column)).collect();
            columns.extend(mirrored.into_iter().filter(|&(angle, _)| angle > about + SAME));
        };
        match system {
            System::C if horizontal.len() == 1 => columns = vec![(0.0, 0), (360.0, 0)],
            System::C if same(first, 0.0) && same(last, 90.0) => {
                mirror(&mut columns, 90.0);
                mirror(&mut columns, 180.0);
            }
            System::C if same(first, 0.0) && same(last, 180.0) => mirror(&mut columns, 180.0),
            System::C if same(first, 90.0) && same(last, 270.0) => {
                mirror(&mut columns, 270.0);
                // 270 to 450 is 270 to 360 and 0 to 90.
                columns.iter_mut().for_each(|(angle, _)| *angle -= if *angle > 360.0 + SAME { 360.0 } else { 0.0 });
                columns.sort_by(|a, b| a.0.total_cmp(&b.0));
                columns.dedup_by(|b, a| same(a.0, b.0));
                close(&mut columns);
            }
            System::C if last - first > 180.0 + SAME && last - first < 360.0 + SAME => {
                columns.iter_mut().for_each(|(angle, _)| *angle = angle.rem_euclid(360.0));
                columns.sort_by(|a, b| a.0.total_cmp(&b.0));
                columns.dedup_by(|b, a| same(a.0, b.0));
                close(&mut columns);
            }
            System::A | System::B if same(first, 0.0) && last > SAME && last <= 180.0 + SAME => {
                let behind = columns.iter().rev().filter(|(angle, _)| *angle > SAME);
                columns = behind.map(|&(angle, column)| (-angle, column)).chain(columns.iter().copied()).collect();
            }
            System::A | System::B if first >= -180.0 - SAME && last <= 180.0 + SAME && horizontal.len() > 1 => {}
            _ => {
                return Err(format!("has horizontal angles from {first} to {last}: no symmetry of its type has those"));
            }
        }
        let count = vertical.len();
        if columns.len().saturating_mul(count) > MAX_VALUES {
            return Err(format!("has {count} by {} intensities: no profile has that many", columns.len()));
        }
        let around: Vec<f64> = columns.iter().map(|&(angle, _)| angle.to_radians()).collect();
        let profile = match system {
            System::C | System::A => Self {
                system,
                polar: vertical.iter().map(|angle| (angle - low).to_radians()).collect(),
                azimuth: around,
                intensities: columns
                    .iter()
                    .flat_map(|&(_, c)| &intensities[c * count..(c + 1) * count])
                    .copied()
                    .collect(),
            },
            // The pole is horizontal: the roles of the angles change.
            System::B => Self {
                system,
                polar: around.iter().map(|angle| angle + PI / 2.0).collect(),
                azimuth: vertical.iter().map(|angle| angle.to_radians()).collect(),
                intensities: (0..count)
                    .flat_map(|v| columns.iter().map(move |&(_, c)| (c, v)))
                    .map(|(c, v)| intensities[c * count + v])
                    .collect(),
            },
        };
        Ok(profile)
    }

    /// Candela in the direction `d`, a unit vector of travel in the light's space.
    pub fn intensity(&self, d: DVec3) -> f64 {
        let (polar, azimuth) = match self.system {
            System::C => {
                let azimuth = libm::atan2(-d.y, -d.x);
                (libm::acos((-d.z).clamp(-1.0, 1.0)), if azimuth < 0.0 { azimuth + TAU } else { azimuth })
            }
            System::A => (libm::acos((-d.y).clamp(-1.0, 1.0)), libm::atan2(d.x, -d.z)),
            System::B => (libm::acos((-d.x).clamp(-1.0, 1.0)), libm::atan2(d.y, -d.z)),
        };
        let (Some((p, u)), Some((a, v))) = (locate(&self.polar, polar), locate(&self.azimuth, azimuth)) else {
            return 0.0;
        };
        let at = |a: usize, p: usize| self.intensities[a * self.polar.len() + p];
        let along = |a: usize| at(a, p) + u * (at(a, p + 1) - at(a, p));
        along(a) + v * (along(a + 1) - along(a))
    }

    /// The mean intensity over the sphere, or over the hemisphere where the profile spans no more: what
    /// `ies:normalize` divides by, as hdEmbree has it. Of the linear interpolation it is exact.
    pub fn mean(&self) -> f64 {
        let pairs = |values: &[f64]| (0..values.len() - 1).collect::<Vec<_>>();
        let mut flux = 0.0;
        for a in pairs(&self.azimuth) {
            let width = self.azimuth[a + 1] - self.azimuth[a];
            for p in pairs(&self.polar) {
                let (low, high) = (self.polar[p], self.polar[p + 1]);
                let at = |p: usize| {
                    let of = |a: usize| self.intensities[a * self.polar.len() + p];
                    0.5 * (of(a) + of(a + 1))
                };
                flux += width * ring(low, high, at(p), at(p + 1));
            }
        }
        // hdEmbree tells the two apart by the span of the vertical angles, with 0.1 rad of tolerance.
        let ends = |angles: &[f64]| angles[angles.len() - 1] - angles[0];
        let vertical = if self.system == System::B { &self.azimuth } else { &self.polar };
        let is_sphere = ends(vertical) > PI / 2.0 + 0.1;
        flux / (if is_sphere { 4.0 } else { 2.0 } * PI)
    }
}

/// Adds the column at 0 once more at 360, and before it the last one where there is none at 0.
fn close(columns: &mut Vec<(f64, usize)>) {
    let (first, last) = (columns[0], columns[columns.len() - 1]);
    if first.0 > SAME {
        columns.insert(0, (last.0 - 360.0, last.1));
    }
    if last.0 < 360.0 - SAME {
        columns.push((first.0 + 360.0, first.1));
    }
}

/// ∫ I(θ) sin θ dθ of what is linear between two angles.
fn ring(low: f64, high: f64, at_low: f64, at_high: f64) -> f64 {
    let slope = (at_high - at_low) / (high - low);
    // ∫ (a + s θ) sin θ = −(a + s θ) cos θ + s sin θ.
    at_low * libm::cos(low) - at_high * libm::cos(high) + slope * (libm::sin(high) - libm::sin(low))
}

/// The interval that holds `angle` and where in it; `None` outside, up to rounding.
fn locate(angles: &[f64], angle: f64) -> Option<(usize, f64)> {
    const ROUNDING: f64 = 1e-9;
    let last = angles.len() - 1;
    if angle < angles[0] - ROUNDING || angle > angles[last] + ROUNDING {
        return None;
    }
    let below = angles.partition_point(|&a| a <= angle).clamp(1, last) - 1;
    let fraction = (angle - angles[below]) / (angles[below + 1] - angles[below]);
    Some((below, fraction.clamp(0.0, 1.0)))
}

/// What the TILT line says, and the text behind it.
fn after_tilt(text: &str) -> Option<(&str, &str)> {
    let mut rest = text;
    while !rest.is_empty() {
        // Lines may end as those of old Macs do.
        let end = rest.find(['\n', '\r']).unwrap_or(rest.len());
        let (line, behind) = rest.split_at(end);
        rest = behind.trim_start_matches(['\n', '\r']);
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.get(..4).is_some_and(|word| word.eq_ignore_ascii_case("TILT"))
            && let Some(value) = line[4..].trim_start().strip_prefix('=')
        {
            return Some((value.trim(), rest));
        }
    }
    None
}

/// Numbers, separated by spaces, line ends and commas.
struct Numbers<'a>(&'a str);

impl Numbers<'_> {
    fn next(&mut self, what: &str) -> Result<f64, String> {
        let is_between = |c: char| c.is_whitespace() || c == ',' || c == '\0';
        let rest = self.0.trim_start_matches(is_between);
        let (word, behind) = rest.split_at(rest.find(is_between).unwrap_or(rest.len()));
        self.0 = behind;
        if word.is_empty() {
            return Err(format!("ends before its {what}"));
        }
        // Words that Rust takes for numbers are none here.
        let is_number = word.parse::<f64>().ok().filter(|value| value.is_finite());
        is_number.ok_or_else(|| {
            let shown: String = word.chars().take(20).collect();
            format!("has '{}' where its {what} should be", shown.escape_debug())
        })
    }

    /// A whole number that is not negative.
    fn count(&mut self, what: &str) -> Result<usize, String> {
        let value = self.next(what)?;
        if value.fract() != 0.0 || !(0.0..=MAX_VALUES as f64).contains(&value) {
            return Err(format!("has {value} as its {what}"));
        }
        Ok(value as usize)
    }

    fn angles(&mut self, what: &str, count: usize) -> Result<Vec<f64>, String> {
        let mut angles = Vec::new();
        for _ in 0..count {
            let angle = self.next(what)?;
            if let Some(&before) = angles.last()
                && angle <= before
            {
                return Err(format!("has {angle} after {before} in its {what}: they increase"));
            }
            angles.push(angle);
        }
        Ok(angles)
    }
}

#[cfg(test)]
mod tests;
