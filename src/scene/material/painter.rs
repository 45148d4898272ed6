//! Inputs of a shader as registers, constants or networks, and the arithmetic between them.
//!
//! An input that is driven by a network that is not understood, or authored as no value of its type, has the default of its
//! node definition, with a warning.

use std::collections::{BTreeMap, BTreeSet};

use crate::diagnostics::Diagnostics;
use crate::scene::description::Shader;
use crate::texture::{Builder, Function as F, Register, TooLarge};

use super::network::Networks;
use super::values::Values;

/// Registers, or that there are too many.
pub(super) type Painted<T = Register> = Result<T, TooLarge>;

/// What reads a shader's inputs.
pub(super) struct Painter<'a, 'n, 'd> {
    shader: &'a Shader,
    values: Values<'a>,
    pub(super) networks: &'n mut Networks,
    diagnostics: &'d mut Diagnostics,
    /// What was read already: an oddity is told once.
    known: BTreeMap<String, Option<Register>>,
    /// Driven inputs of which it has been said that their default is used.
    defaulted: BTreeSet<String>,
}

impl<'a, 'n, 'd> Painter<'a, 'n, 'd> {
    /// Of `shader`, whose driven inputs are `networks`.
    pub(super) fn new(shader: &'a Shader, networks: &'n mut Networks, diagnostics: &'d mut Diagnostics) -> Self {
        let values = Values::new(&shader.inputs, &shader.path, "inputs:");
        Self { shader, values, networks, diagnostics, known: BTreeMap::new(), defaulted: BTreeSet::new() }
    }

    /// Says of nothing in `defaulted` again that its default is used.
    pub(super) fn after(self, defaulted: BTreeSet<String>) -> Self {
        Self { defaulted, ..self }
    }

    /// The identifier of the shader.
    pub(super) fn id(&self) -> &'a str {
        &self.shader.id
    }

    /// The operations.
    pub(super) fn b(&mut self) -> &mut Builder {
        &mut self.networks.builder
    }

    /// A colour, or one number for a grey.
    pub(super) fn color<'i>(&mut self, input: impl Into<(&'i str, [f32; 3])>) -> Painted {
        let (name, default) = input.into();
        let register = self.input(name, |painter| {
            let authored = painter.authored(name, Values::color)?;
            let [r, g, b] = authored.map(|x| x as f32);
            Some(painter.b().constant([r, g, b, 1.0]))
        })?;
        let [r, g, b] = default;
        register.map_or_else(|| self.b().constant([r, g, b, 1.0]), Ok)
    }

    /// A number, in all four places.
    pub(super) fn number<'i>(&mut self, input: impl Into<(&'i str, f32)>) -> Painted {
        let (name, default) = input.into();
        let register = self.input(name, |painter| {
            let authored = painter.authored(name, Values::number)?;
            Some(painter.b().number(authored as f32))
        })?;
        match register {
            Some(register) => self.b().swizzle(register, "x"),
            None => self.b().number(default),
        }
    }

    /// The mean of a colour, which may be authored as a number.
    pub(super) fn mean_of_color<'i>(&mut self, input: impl Into<(&'i str, f32)>) -> Painted {
        let (name, default) = input.into();
        let color = self.color((name, [default; 3]))?;
        let third = self.b().number(1.0 / 3.0)?;
        // Of equal numbers exactly that number.
        match self.b().value(color) {
            #[allow(clippy::float_cmp, reason = "greys are authored as three equal numbers")]
            Some([r, g, b, _]) if r == g && g == b => self.b().number(r),
            _ => self.b().binary(F::Dot(3), color, third),
        }
    }

    /// A switch; what drives it is not followed.
    pub(super) fn switch<'i>(&mut self, input: impl Into<(&'i str, bool)>) -> bool {
        let (name, default) = input.into();
        self.authored(name, Values::switch).unwrap_or(default)
    }

    /// A word of a list, by itself or by its place in it; what drives it is not followed.
    pub(super) fn word<'i>(&mut self, input: impl Into<(&'i str, &'i str)>, words: &[&'i str]) -> &'i str {
        let (name, default) = input.into();
        let Some(authored) = self.values.raw(name) else { return default };
        let found = match authored.value.as_i64() {
            Some(index) => usize::try_from(index).ok().and_then(|index| words.get(index)),
            None => authored.value.as_str().and_then(|text| words.iter().find(|word| **word == text)),
        };
        // A word that is none of them is an error of the classification, which has been.
        found.copied().unwrap_or(default)
    }

    /// What computes the input, if a network does.
    pub(super) fn network(&mut self, name: &str) -> Option<Register> {
        self.driven(name)
    }

    fn input(
        &mut self,
        name: &str,
        authored: impl FnOnce(&mut Self) -> Option<Painted>,
    ) -> Result<Option<Register>, TooLarge> {
        if name.is_empty() {
            return Ok(None);
        }
        if let Some(known) = self.known.get(name) {
            return Ok(*known);
        }
        let register = match self.driven(name) {
            Some(register) => Some(register),
            None => authored(self).transpose()?,
        };
        self.known.insert(name.to_owned(), register);
        Ok(register)
    }

    /// An authored constant; what is no value of its type is warned of, and is none.
    pub(super) fn authored<T>(
        &mut self,
        name: &str,
        read: impl Fn(&Values<'a>, &str) -> crate::Result<Option<T>>,
    ) -> Option<T> {
        if name.is_empty() || self.shader.connected.contains_key(name) {
            return None;
        }
        read(&self.values, name).unwrap_or_else(|_| {
            self.warn(name, "is no value of its type: its default is used");
            None
        })
    }

    /// What drives the input `name`; `None` where nothing does, or, with a warning, what is not understood.
    fn driven(&mut self, name: &str) -> Option<Register> {
        if name.is_empty() || !self.shader.connected.contains_key(name) {
            return None;
        }
        let register = self.networks.register(name);
        if register.is_none() && !self.defaulted.contains(name) {
            let why = self.networks.obstacle(name).map_or_else(String::new, |obstacle| format!(" ({obstacle})"));
            self.warn(name, &format!("is driven by a network that is not understood{why}: its default is used"));
        }
        register
    }

    pub(super) fn warn(&mut self, name: &str, message: &str) {
        self.diagnostics.warn("unread-network", self.values.place(name), message);
    }
}

/// Arithmetic.
impl Painter<'_, '_, '_> {
    /// Whether `x` is this number in all four places, and constant.
    pub(super) fn is(&mut self, x: Register, number: f32) -> bool {
        self.b().value(x) == Some([number; 4])
    }

    pub(super) fn constant(&mut self, value: f32) -> Painted {
        self.b().number(value)
    }

    pub(super) fn gray(&mut self, value: f32) -> Painted {
        self.b().constant([value, value, value, 1.0])
    }

    pub(super) fn add(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::Add, x, y)
    }

    pub(super) fn subtract(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::Subtract, x, y)
    }

    pub(super) fn multiply(&mut self, x: Register, y: Register) -> Painted {
        // 1 leaves a value as it is, and costs nothing.
        if self.is(y, 1.0) {
            Ok(x)
        } else if self.is(x, 1.0) {
            Ok(y)
        } else {
            self.b().binary(F::Multiply, x, y)
        }
    }

    pub(super) fn divide(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::Divide, x, y)
    }

    pub(super) fn one_minus(&mut self, x: Register) -> Painted {
        let one = self.constant(1.0)?;
        self.subtract(one, x)
    }

    pub(super) fn square(&mut self, x: Register) -> Painted {
        self.b().binary(F::Multiply, x, x)
    }

    pub(super) fn sqrt(&mut self, x: Register) -> Painted {
        self.b().unary(F::Sqrt, x)
    }

    pub(super) fn power(&mut self, x: Register, exponent: Register) -> Painted {
        self.b().binary(F::Power, x, exponent)
    }

    pub(super) fn min(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::Min, x, y)
    }

    pub(super) fn max(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::Max, x, y)
    }

    /// `x` within the numbers `low` and `high`.
    pub(super) fn clamp(&mut self, x: Register, low: f32, high: f32) -> Painted {
        let (low, high) = (self.constant(low)?, self.constant(high)?);
        self.b().ternary(F::Clamp, x, low, high)
    }

    /// x (1 − t) + y t; the ends themselves where t is constant.
    pub(super) fn mix(&mut self, x: Register, y: Register, t: Register) -> Painted {
        if self.is(t, 0.0) {
            Ok(x)
        } else if self.is(t, 1.0) {
            Ok(y)
        } else {
            self.b().ternary(F::Mix, y, x, t)
        }
    }

    /// 1 where x ≥ y, else 0.
    pub(super) fn is_at_least(&mut self, x: Register, y: Register) -> Painted {
        self.b().binary(F::GreaterOrEqual, x, y)
    }

    /// The greatest and the least component of a colour.
    pub(super) fn extremes(&mut self, color: Register) -> Result<[Register; 2], TooLarge> {
        let b = self.b();
        let [r, g, blue] = [b.swizzle(color, "x")?, b.swizzle(color, "y")?, b.swizzle(color, "z")?];
        let (most, least) = (b.binary(F::Max, r, g)?, b.binary(F::Min, r, g)?);
        Ok([b.binary(F::Max, most, blue)?, b.binary(F::Min, least, blue)?])
    }
}
