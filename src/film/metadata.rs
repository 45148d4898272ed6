//! What an image says about itself, independent of the file format.

/// A typed header value.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// UTF-8 text.
    Text(String),
    /// Integer.
    Int(i32),
    /// Single precision.
    Float(f32),
    /// Double precision.
    Double(f64),
    /// Two floats.
    Vec2([f32; 2]),
    /// Row-major 4 × 4 matrix for row vectors.
    Matrix([f32; 16]),
    /// Numerator and denominator.
    Rational(i32, u32),
    /// CIE x, y of red, green, blue and white.
    Chromaticities([[f32; 2]; 4]),
}

/// Header of an image: attributes in a fixed order, and how the pixels are packed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Metadata {
    /// Name and value; a name stands once.
    pub attributes: Vec<(String, Attribute)>,
    /// EXR compression by its OpenEXR name: `zip`, `zips`, `piz`, `rle`, `none`; empty for the default.
    pub compression: String,
}

impl Metadata {
    /// Sets `name`, replacing an earlier value.
    pub fn set(&mut self, name: impl Into<String>, value: Attribute) {
        let name = name.into();
        match self.attributes.iter_mut().find(|(known, _)| *known == name) {
            Some(entry) => entry.1 = value,
            None => self.attributes.push((name, value)),
        }
    }

    /// The value of `name`.
    pub fn get(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }
}
