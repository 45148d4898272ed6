//! Inputs of a shader, each read with its definition's default.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Display;

use crate::diagnostics::Diagnostics;
use crate::error::Result;
use crate::optics::media::Priority;
use crate::scene::description::Shader;

use super::super::values::Values;
use super::super::{SMOOTH_ROUGHNESS, THRESHOLD};

/// An input of a node definition, and its value where none is authored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Input<T> {
    pub(super) name: &'static str,
    pub(super) default: T,
}

pub(super) type Number = Input<f64>;
pub(super) type Color = Input<[f64; 3]>;
pub(super) type Switch = Input<bool>;
pub(super) type Integer = Input<i32>;
pub(super) type Word = Input<&'static str>;

pub(super) const fn input<T: Copy>(name: &'static str, default: T) -> Input<T> {
    Input { name, default }
}

impl From<Number> for (&'static str, f32) {
    fn from(input: Number) -> Self {
        (input.name, input.default as f32)
    }
}

impl From<Color> for (&'static str, [f32; 3]) {
    fn from(input: Color) -> Self {
        (input.name, input.default.map(|x| x as f32))
    }
}

impl From<Switch> for (&'static str, bool) {
    fn from(input: Switch) -> Self {
        (input.name, input.default)
    }
}

impl From<Word> for (&'static str, &'static str) {
    fn from(input: Word) -> Self {
        (input.name, input.default)
    }
}

/// An input of any type: a line of the table in `docs/materials.md`.
#[cfg(test)]
#[derive(Clone, Copy, Debug)]
pub(super) enum Declared {
    Number(Number),
    Color(Color),
    Switch(Switch),
    Integer(Integer),
    Word(Word),
    /// A number whose definition has no default: not authored it says nothing.
    Unset(&'static str),
}

/// A weight between what a surface is and is not, under its input's name.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    pub(super) name: &'static str,
    pub(super) value: f64,
}

impl Display for Weight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}", self.name, self.value)
    }
}

/// What is authored on one shader.
pub(super) struct Inputs<'a> {
    shader: &'a Shader,
    values: Values<'a>,
    /// Driven inputs that are looked up where a ray meets the surface.
    looked_up: BTreeSet<String>,
    /// Driven inputs whose default was used, which has been said.
    defaulted: RefCell<BTreeSet<String>>,
}

impl<'a> Inputs<'a> {
    pub(super) fn new(shader: &'a Shader) -> Self {
        let values = Values::new(&shader.inputs, &shader.path, "inputs:");
        Self { shader, values, looked_up: BTreeSet::new(), defaulted: RefCell::default() }
    }

    pub(super) fn shader(&self) -> &'a Shader {
        self.shader
    }

    /// Driven inputs whose default was used, with a warning.
    pub(super) fn defaulted(&self) -> BTreeSet<String> {
        self.defaulted.borrow().clone()
    }

    /// Says which driven inputs can be looked up.
    pub(super) fn look_up(&mut self, can: impl Fn(&str) -> bool) {
        self.looked_up = self.shader.connected.keys().filter(|name| can(name)).cloned().collect();
    }

    /// Whether the input differs from point to point, and is looked up there.
    pub(super) fn is_looked_up(&self, name: &str) -> bool {
        self.looked_up.contains(name)
    }

    /// `</World/Glass/Shader>.inputs:ior`
    pub(super) fn place(&self, name: &str) -> String {
        self.values.place(name)
    }

    /// An error about an input, which it shows.
    pub(super) fn refuse<T>(&self, name: &str, problem: impl AsRef<str>) -> Result<T> {
        self.values.refuse(name, problem)
    }

    /// `inputs:ior`, or that it is the default.
    pub(super) fn source(&self, name: &str) -> String {
        match self.values.has(name) && !self.is_connected(name) {
            true => format!("inputs:{name}"),
            false => format!("the default of inputs:{name}"),
        }
    }

    pub(super) fn number(&self, input: Number, diagnostics: &mut Diagnostics) -> Result<f64> {
        Ok(self.unset_number(input.name, input.default, diagnostics)?.unwrap_or(input.default))
    }

    /// A number ≥ 0.
    pub(super) fn length(&self, input: Number, diagnostics: &mut Diagnostics) -> Result<f64> {
        let length = self.number(input, diagnostics)?;
        if length < 0.0 {
            return self.refuse(input.name, "author 0 or more");
        }
        Ok(length)
    }

    pub(super) fn weight(&self, input: Number, diagnostics: &mut Diagnostics) -> Result<Weight> {
        Ok(Weight { name: input.name, value: self.number(input, diagnostics)? })
    }

    /// The weight of the metal. A painted one makes no uniform mirror and hides no glass: it counts as 0, and being
    /// common and harmless to the chain it is no warning.
    pub(super) fn metalness(&self, input: Number) -> Result<Weight> {
        let value = match self.is_connected(input.name) {
            true => 0.0,
            false => self.values.number(input.name)?.unwrap_or(input.default),
        };
        Ok(Weight { name: input.name, value })
    }

    /// Whether a roughness is more than that of a smooth surface.
    pub(super) fn is_rough(&self, input: Number, diagnostics: &mut Diagnostics) -> Result<bool> {
        Ok(self.number(input, diagnostics)? > SMOOTH_ROUGHNESS)
    }

    /// Why the surface is not there, if its opacity says so.
    pub(super) fn cut_out(&self, input: Number, diagnostics: &mut Diagnostics) -> Result<Option<String>> {
        if self.is_looked_up(input.name) {
            return Ok(None);
        }
        let presence = self.weight(input, diagnostics)?;
        Ok((presence.value < THRESHOLD).then(|| presence.to_string()))
    }

    /// A number without a default.
    pub(super) fn authored_number(&self, name: &'static str, diagnostics: &mut Diagnostics) -> Result<Option<f64>> {
        self.unset_number(name, "not authored", diagnostics)
    }

    fn unset_number(&self, name: &str, shown: impl Display, diagnostics: &mut Diagnostics) -> Result<Option<f64>> {
        if self.is_driven(name, shown, diagnostics) {
            return Ok(None);
        }
        self.values.number(name)
    }

    /// A colour; one number is a grey.
    pub(super) fn color(&self, input: Color, diagnostics: &mut Diagnostics) -> Result<[f64; 3]> {
        let [r, g, b] = input.default;
        if self.is_driven(input.name, format!("({r}, {g}, {b})"), diagnostics) {
            return Ok(input.default);
        }
        Ok(self.values.color(input.name)?.unwrap_or(input.default))
    }

    /// A colour that is a transmittance: each component from 0 to 1.
    pub(super) fn transmittance(&self, input: Color, diagnostics: &mut Diagnostics) -> Result<[f64; 3]> {
        let color = self.color(input, diagnostics)?;
        if color.iter().any(|part| !(0.0..=1.0).contains(part)) {
            return self.refuse(input.name, "author a transmittance: each component from 0 to 1");
        }
        Ok(color)
    }

    /// The authored value itself.
    pub(super) fn raw(&self, name: &str) -> Option<&'a serde_json::Value> {
        self.values.raw(name).map(|authored| &authored.value)
    }

    pub(super) fn switch(&self, input: Switch, diagnostics: &mut Diagnostics) -> Result<bool> {
        if self.is_driven(input.name, input.default, diagnostics) {
            return Ok(input.default);
        }
        Ok(self.values.switch(input.name)?.unwrap_or(input.default))
    }

    pub(super) fn integer(&self, input: Integer) -> Result<i32> {
        Ok(self.values.int(input.name)?.unwrap_or(input.default))
    }

    /// A word out of `words`, by itself or by its place among them: tokens of USD are enumerations of MaterialX.
    pub(super) fn word(&self, input: Word, words: &[&'static str]) -> Result<&'static str> {
        let Some(authored) = self.values.raw(input.name) else { return Ok(input.default) };
        let found = match authored.value.as_i64() {
            Some(index) => usize::try_from(index).ok().and_then(|index| words.get(index)),
            None => match self.values.text(input.name)? {
                None => return Ok(input.default),
                Some(text) => words.iter().find(|word| **word == text),
            },
        };
        match found {
            Some(word) => Ok(word),
            None => self.refuse(input.name, format!("author one of {}", words.join(", "))),
        }
    }

    /// A priority in the order of `convert`, with its place and that order in words.
    pub(super) fn priority(
        &self,
        input: Integer,
        convert: fn(i32) -> Priority,
        order: &str,
    ) -> Result<Option<(Priority, String)>> {
        let number = self.integer(input)?;
        let priority = convert(number);
        let source = || format!("{number} ({order}) from {}", self.place(input.name));
        Ok((priority != Priority::UNSET).then(|| (priority, source())))
    }

    /// Warns of an input that is authored and has no counterpart here.
    pub(super) fn warn_unread(&self, name: &str, message: &str, diagnostics: &mut Diagnostics) {
        diagnostics.warn("unread-input", self.place(name), message);
    }

    fn is_connected(&self, name: &str) -> bool {
        self.shader.connected.contains_key(name)
    }

    fn is_driven(&self, name: &str, default: impl Display, diagnostics: &mut Diagnostics) -> bool {
        let driven = self.is_connected(name);
        if driven {
            self.defaulted.borrow_mut().insert(name.to_owned());
            diagnostics.warn(
                "textured-input",
                self.place(name),
                format!(
                    "is driven by a network, which the specular chain does not read: its default {default} is used"
                ),
            );
        }
        driven
    }
}
