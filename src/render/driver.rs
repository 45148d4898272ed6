//! What a product's driver is asked for (`driver:parameters:…`): compression, and what else stands in the header.

use serde_json::Value;

use crate::diagnostics::Diagnostics;
use crate::exr::standard_type;
use crate::film::metadata::Attribute;
use crate::scene::description::{Authored, Product};

/// Parameters of Solaris' OpenEXR driver that are attributes of the header, and their names there.
const HEADER: &[(&str, &str)] = &[("artist", "artist"), ("comment", "comments"), ("hostname", "hostname")];

/// Lossless compressions that are written.
const LOSSLESS: &[&str] = &["zip", "zips", "piz", "rle", "none"];

/// What the driver of a product does.
#[derive(Default)]
pub(super) struct Driver {
    /// OpenEXR's name; empty for the default.
    pub(super) compression: String,
    /// Attributes of the header.
    pub(super) header: Vec<(String, Attribute)>,
}

impl Driver {
    pub(super) fn new(product: &Product, diagnostics: &mut Diagnostics) -> Self {
        if !matches!(product.product_type.as_str(), "" | "raster") {
            diagnostics.warn(
                "product-type",
                &product.path,
                format!("products of type '{}' are not written: it is written as a raster", product.product_type),
            );
        }
        let mut driver = Self::default();
        for (name, authored) in &product.driver {
            let place = || format!("{}.driver:parameters:{name}", product.path);
            let short = name.strip_prefix("OpenEXR:").unwrap_or(name);
            match short {
                "compression" => {
                    let asked = authored.value.as_str().unwrap_or_default();
                    if LOSSLESS.contains(&asked) {
                        driver.compression = asked.to_owned();
                    } else if !asked.is_empty() {
                        diagnostics.warn(
                            "compression",
                            place(),
                            format!("compression '{asked}' would lose digits of derivatives: zip is written"),
                        );
                    }
                }
                // The level of a compression that is not written: its warning says so.
                "dwa_compression" => {}
                _ => match HEADER.iter().find(|(parameter, _)| *parameter == short) {
                    Some((_, attribute)) => driver.set(attribute, authored, place(), diagnostics),
                    None if name.starts_with("OpenEXR:") => driver.set(short, authored, place(), diagnostics),
                    None => diagnostics.warn(
                        "unused-driver-parameter",
                        place(),
                        "has no effect here: compression, artist, comment, hostname and OpenEXR:… do",
                    ),
                },
            }
        }
        driver
    }

    fn set(&mut self, name: &str, authored: &Authored, place: String, diagnostics: &mut Diagnostics) {
        let value = attribute(&authored.value, standard_type(name));
        let problem = match &value {
            Some(value) => crate::exr::check_attribute(name, value).err().map(|e| e.to_string()),
            None => Some("has a value that no attribute of the header can hold".to_owned()),
        };
        match (value, problem) {
            (Some(value), None) => self.header.push((name.to_owned(), value)),
            (_, problem) => {
                diagnostics.warn("header-attribute", place, format!("{}: left out", problem.unwrap_or_default()));
            }
        }
    }
}

/// A value as an attribute, of the type that OpenEXR defines for it if it does.
fn attribute(value: &Value, standard: Option<&str>) -> Option<Attribute> {
    if let Some(text) = value.as_str() {
        return Some(Attribute::Text(text.to_owned()));
    }
    if let (Some(number), Some("float")) = (value.as_f64(), standard) {
        return Some(Attribute::Float(number as f32));
    }
    if let Some(integer) = value.as_i64().or(value.as_bool().map(i64::from)) {
        return i32::try_from(integer).ok().map(Attribute::Int);
    }
    if let Some(number) = value.as_f64() {
        return Some(Attribute::Double(number));
    }
    let mut numbers = Vec::new();
    for item in value.as_array()? {
        match item.as_array() {
            Some(row) => numbers.extend(row.iter().map(Value::as_f64)),
            None => numbers.push(item.as_f64()),
        }
    }
    let numbers: Vec<f32> = numbers.into_iter().map(|n| n.map(|n| n as f32)).collect::<Option<_>>()?;
    match numbers.len() {
        2 => numbers.try_into().ok().map(Attribute::Vec2),
        16 => numbers.try_into().ok().map(Attribute::Matrix),
        _ => Some(Attribute::Text(value.to_string())),
    }
}
