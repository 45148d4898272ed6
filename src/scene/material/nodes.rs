//! What the nodes of shading networks compute, as operations.
//!
//! UsdPreviewSurface's nodes by OpenUSD's `spec_usdpreviewsurface` 2.6; MaterialX' nodes by the MaterialX Specification
//! v1.39 and its standard library (`libraries/stdlib`, and `bxdf/gltf_pbr.mtlx` for glTF's image nodes); Arnold's `image`
//! and RenderMan's `PxrTexture` by what their documentation says of these inputs. One number stands in all four places of
//! a register, so that a colour times a number is one multiplication.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::error::Result;
use crate::scene::description::{Node, NodeOutput};
use crate::texture::{Builder, ColorSpace, Function as F, Lookup, Register, TooLarge, Wrap};

use super::network::Obstacle;
use super::resources::Resources;

type Compiled<T> = std::result::Result<T, Obstacle>;

impl From<TooLarge> for Obstacle {
    fn from(_: TooLarge) -> Self {
        Self::TooLarge
    }
}

/// The inputs of a node, as constants or registers.
pub(super) struct Inputs<'a> {
    pub(super) node: &'a Node,
    pub(super) known: &'a BTreeMap<&'a NodeOutput, Compiled<Register>>,
}

/// Components of a colour or vector; the last part of a node's identifier.
fn width(mtlx_type: &str) -> Option<usize> {
    Some(match mtlx_type {
        "float" | "integer" | "boolean" => 1,
        "vector2" => 2,
        "color3" | "vector3" => 3,
        "color4" | "vector4" => 4,
        _ => return None,
    })
}

/// Of a primvar reader of USD.
fn reader_width(suffix: &str) -> Option<usize> {
    Some(match suffix {
        "float" | "int" => 1,
        "float2" => 2,
        "float3" | "normal" | "point" | "vector" => 3,
        "float4" => 4,
        _ => return None,
    })
}

impl Inputs<'_> {
    fn unknown<T>(&self, what: impl Into<String>) -> Compiled<T> {
        Err(Obstacle::Unknown(what.into()))
    }

    /// The input `name`, if somebody gave it a value.
    fn given(&self, name: &str, b: &mut Builder) -> Compiled<Option<Register>> {
        if let Some(output) = self.node.connected.get(name) {
            return self.known[output].clone().map(Some);
        }
        match self.node.inputs.get(name) {
            None => Ok(None),
            Some(authored) => match numbers(&authored.value) {
                Some(value) => Ok(Some(b.constant(value)?)),
                None => self.unknown(format!("the value of inputs:{name} of the node '{}'", self.node.id)),
            },
        }
    }

    fn or(&self, name: &str, default: [f32; 4], b: &mut Builder) -> Compiled<Register> {
        match self.given(name, b)? {
            Some(register) => Ok(register),
            None => Ok(b.constant(default)?),
        }
    }

    fn number(&self, name: &str, default: f32, b: &mut Builder) -> Compiled<Register> {
        self.or(name, [default; 4], b)
    }

    fn text(&self, name: &str) -> Option<&str> {
        self.node.inputs.get(name)?.value.as_str().filter(|text| !text.is_empty())
    }

    fn integer(&self, name: &str, default: i64) -> i64 {
        self.node.inputs.get(name).and_then(|authored| authored.value.as_i64()).unwrap_or(default)
    }

    fn wrap(&self, name: &str, default: Wrap) -> Compiled<Wrap> {
        match self.text(name) {
            None => Ok(default),
            Some(text) => Wrap::named(text).map_or_else(|| self.unknown(format!("inputs:{name} = {text}")), Ok),
        }
    }
}

/// One to four numbers or a switch; one stands in all places, others are filled with 0 and, in the fourth, 1.
fn numbers(value: &Value) -> Option<[f32; 4]> {
    let number = |value: &Value| value.as_f64().map(|x| x as f32).filter(|x| x.is_finite());
    match value {
        Value::Bool(truth) => Some([f32::from(u8::from(*truth)); 4]),
        Value::Array(parts) if (2..=4).contains(&parts.len()) => {
            let mut all = [0.0, 0.0, 0.0, 1.0];
            for (to, part) in all.iter_mut().zip(parts) {
                *to = number(part)?;
            }
            Some(all)
        }
        value => number(value).map(|x| [x; 4]),
    }
}

/// What `output` of a node is: operations, or what stands in the way. Errors are those of a damaged file.
pub(super) fn compile(
    inputs: &Inputs<'_>,
    output: &str,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Result<Compiled<Register>> {
    let id = inputs.node.id.as_str();
    if let Some(&index) = inputs.node.textures.values().next() {
        let place = format!("<{}>", inputs.node.path);
        let (images, color_space) = resources.images(index, &place)?;
        let file = File { images, color_space };
        return Ok(image(inputs, id, output, file, b, resources));
    }
    Ok(computed(inputs, id, output, b, resources))
}

/// The image that a node names.
struct File<'a> {
    images: crate::texture::Images,
    color_space: &'a str,
}

/// A node that looks an image up, or fails to name one.
fn image(
    inputs: &Inputs<'_>,
    id: &str,
    output: &str,
    file: File<'_>,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    if id == "UsdUVTexture" || id.starts_with("ND_UsdUVTexture") {
        return uv_texture(inputs, id, output, file, b, resources);
    }
    let category = id.strip_prefix("ND_").map(|rest| rest.split('_').next().unwrap_or(rest));
    match (category, id) {
        (Some("image" | "tiledimage"), _) => materialx_image(inputs, id, output, file, b, resources),
        (Some("gltf"), _) => gltf_image(inputs, id, output, file, b, resources),
        (None, "arnold:image" | "image") => {
            let wrap = |name| match inputs.text(name) {
                Some("clamp") => Wrap::Clamp,
                Some("black") => Wrap::Border,
                Some("mirror") => Wrap::Mirror,
                _ => Wrap::Repeat,
            };
            let uv = match inputs.text("uvset") {
                Some(name) => primvar(name, 2, None, b, resources)?,
                None => default_uv(0, b, resources)?,
            };
            let space = stated(file.color_space, inputs)?;
            let lookup = Lookup {
                images: file.images,
                space,
                wrap: [wrap("swrap"), wrap("twrap")],
                border: [0.0; 4],
                closest: false,
            };
            let fallback = inputs.or("missing_texture_color", [0.0; 4], b)?;
            let texel = b.texture(lookup, uv, fallback)?;
            let multiply = inputs.or("multiply", [1.0; 4], b)?;
            let offset = inputs.or("offset", [0.0, 0.0, 0.0, 0.0], b)?;
            let scaled = b.binary(F::Multiply, texel, multiply)?;
            channel(b.binary(F::Add, scaled, offset)?, output, b)
        }
        (None, "PxrTexture") => {
            let uv = match inputs.given("manifold", b)? {
                Some(uv) => uv,
                None => default_uv(0, b, resources)?,
            };
            let is_linear = inputs.integer("linearize", 0) == 0 && file.color_space.is_empty();
            let space = if is_linear { Some(ColorSpace::RAW) } else { stated(file.color_space, inputs)? };
            let fallback = inputs.or("missingColor", [1.0, 0.0, 1.0, 1.0], b)?;
            let wrap = [Wrap::Repeat; 2];
            let lookup = Lookup { images: file.images, space, wrap, border: [0.0; 4], closest: false };
            channel(b.texture(lookup, uv, fallback)?, output, b)
        }
        _ => inputs.unknown(format!("the node '{id}'")),
    }
}

/// The colour space with a name; `None`, for what the file says, where there is no name.
fn stated(name: &str, inputs: &Inputs<'_>) -> Compiled<Option<ColorSpace>> {
    if name.is_empty() || name.eq_ignore_ascii_case("auto") { Ok(None) } else { named(name, inputs).map(Some) }
}

fn named(name: &str, inputs: &Inputs<'_>) -> Compiled<ColorSpace> {
    match ColorSpace::named(name) {
        Some(space) => Ok(space),
        None => inputs.unknown(format!("the colour space '{name}'")),
    }
}

/// One output of a texel: a channel in all places, or all of it.
fn channel(texel: Register, output: &str, b: &mut Builder) -> Compiled<Register> {
    let name = output.strip_prefix("result").unwrap_or(output).to_ascii_lowercase();
    Ok(match name.as_str() {
        "r" | "g" | "b" | "a" | "x" | "y" | "z" | "w" => b.swizzle(texel, &name)?,
        "outr" | "outg" | "outb" | "outa" | "outx" | "outy" | "outz" | "outw" => b.swizzle(texel, &name[3..])?,
        _ => texel,
    })
}

/// The texture coordinates with a number where nothing says which: the primvar `st`, `st1` …
fn default_uv(number: i64, b: &mut Builder, resources: &mut Resources<'_>) -> Compiled<Register> {
    let name = if number == 0 { "st".to_owned() } else { format!("st{number}") };
    primvar(&name, 2, None, b, resources)
}

/// A primvar; of one component it stands in all places.
fn primvar(
    name: &str,
    width: usize,
    fallback: Option<Register>,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    let fallback = match fallback {
        Some(register) => register,
        None => b.constant([0.0; 4])?,
    };
    let value = b.primvar(resources.primvar(name), fallback)?;
    Ok(if width == 1 { b.swizzle(value, "x")? } else { value })
}

fn uv_texture(
    inputs: &Inputs<'_>,
    id: &str,
    output: &str,
    file: File<'_>,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    // MaterialX' definition repeats where USD's says that the file decides, which it then does not.
    let default = if id == "UsdUVTexture" { Wrap::Border } else { Wrap::Repeat };
    let wrap = [inputs.wrap("wrapS", default)?, inputs.wrap("wrapT", default)?];
    let space = match inputs.text("sourceColorSpace") {
        None | Some("auto") => stated(file.color_space, inputs)?,
        Some(name) => Some(named(name, inputs)?),
    };
    let uv = match inputs.given("st", b)? {
        Some(uv) => uv,
        None => default_uv(0, b, resources)?,
    };
    let fallback = inputs.or("fallback", [0.0, 0.0, 0.0, 1.0], b)?;
    let [scale, bias] = [inputs.or("scale", [1.0; 4], b)?, inputs.or("bias", [0.0; 4], b)?];
    let is_plain = b.value(scale) == Some([1.0; 4]) && b.value(bias) == Some([0.0; 4]);
    let lookup = Lookup { images: file.images, space, wrap, border: [0.0; 4], closest: false };
    if is_plain {
        return channel(b.texture(lookup, uv, fallback)?, output, b);
    }
    // The fallback is the value where there is no texture, scaled by nobody: what (fallback − bias)/scale would undo
    // exactly only by chance. So it is chosen behind the scale, by an alpha that no texel has.
    let nowhere = b.constant([f32::NEG_INFINITY; 4])?;
    let texel = b.texture(lookup, uv, nowhere)?;
    let scaled = b.binary(F::Multiply, texel, scale)?;
    let value = b.binary(F::Add, scaled, bias)?;
    let is_nowhere = b.binary(F::Equal, texel, nowhere)?;
    channel(b.ternary(F::Select, fallback, value, is_nowhere)?, output, b)
}

/// The image nodes of the standard library. Without a stated space their numbers are used as they are.
fn materialx_image(
    inputs: &Inputs<'_>,
    id: &str,
    output: &str,
    file: File<'_>,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    let mut uv = match inputs.given("texcoord", b)? {
        Some(uv) => uv,
        None => default_uv(0, b, resources)?,
    };
    if id.starts_with("ND_tiledimage") {
        let [tiling, offset] = [inputs.number("uvtiling", 1.0, b)?, inputs.number("uvoffset", 0.0, b)?];
        let [image, tile] = [inputs.number("realworldimagesize", 1.0, b)?, inputs.number("realworldtilesize", 1.0, b)?];
        uv = b.binary(F::Multiply, uv, tiling)?;
        uv = b.binary(F::Subtract, uv, offset)?;
        uv = b.binary(F::Divide, uv, image)?;
        uv = b.binary(F::Multiply, uv, tile)?;
    }
    let texel = materialx_lookup(inputs, file, uv, b)?;
    sized(texel, id.rsplit('_').next().unwrap_or_default(), output, inputs, b)
}

/// A texel as the type of a node has it.
fn sized(texel: Register, kind: &str, output: &str, inputs: &Inputs<'_>, b: &mut Builder) -> Compiled<Register> {
    match width(kind) {
        Some(1) => Ok(b.swizzle(texel, "x")?),
        Some(_) => channel(texel, output, b),
        None => inputs.unknown(format!("the type {kind}")),
    }
}

fn materialx_lookup(inputs: &Inputs<'_>, file: File<'_>, uv: Register, b: &mut Builder) -> Compiled<Register> {
    let wrap = [inputs.wrap("uaddressmode", Wrap::Repeat)?, inputs.wrap("vaddressmode", Wrap::Repeat)?];
    let default = inputs.number("default", 0.0, b)?;
    let lookup = Lookup {
        images: file.images,
        space: Some(named(file.color_space, inputs)?),
        wrap,
        border: b.value(default).unwrap_or([0.0; 4]),
        closest: inputs.text("filtertype") == Some("closest"),
    };
    Ok(b.texture(lookup, uv, default)?)
}

/// glTF's image nodes: coordinates from the top, turned the other way; v is flipped about the pivot (0, 1).
fn gltf_image(
    inputs: &Inputs<'_>,
    id: &str,
    output: &str,
    file: File<'_>,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    let uv = match inputs.given("texcoord", b)? {
        Some(uv) => uv,
        None => default_uv(0, b, resources)?,
    };
    let one = b.number(1.0)?;
    let scale = inputs.number("scale", 1.0, b)?;
    let scale = b.binary(F::Divide, one, scale)?;
    let minus = b.number(-1.0)?;
    let rotate = inputs.number("rotate", 0.0, b)?;
    let rotate = b.binary(F::Multiply, rotate, minus)?;
    let offset = inputs.number("offset", 0.0, b)?;
    let turned = b.constant([-1.0, 1.0, 0.0, 0.0])?;
    let offset = b.binary(F::Multiply, offset, turned)?;
    let pivot = inputs.or("pivot", [0.0, 1.0, 0.0, 0.0], b)?;
    let is_colorimage = id.starts_with("ND_gltf_colorimage");
    let order = if is_colorimage { 0 } else { inputs.integer("operationorder", 0) };
    let uv = placed(uv, Placing { pivot, scale, rotate, offset, order }, b)?;
    let texel = materialx_lookup(inputs, file, uv, b)?;
    if is_colorimage {
        let [color, geometry] = [inputs.number("color", 1.0, b)?, inputs.number("geomcolor", 1.0, b)?];
        let tinted = b.binary(F::Multiply, texel, color)?;
        return channel(b.binary(F::Multiply, tinted, geometry)?, output, b);
    }
    if id.starts_with("ND_gltf_normalmap") {
        return signed(texel, b);
    }
    let factor = inputs.number("factor", 1.0, b)?;
    let texel = b.binary(F::Multiply, texel, factor)?;
    // `ND_gltf_image_color3_color3_1_0`
    let kind = id.trim_start_matches("ND_gltf_image_").split('_').next().unwrap_or_default();
    sized(texel, kind, output, inputs, b)
}

/// How `place2d` moves coordinates.
struct Placing {
    pivot: Register,
    scale: Register,
    rotate: Register,
    offset: Register,
    /// 0: scale, rotate, move; 1: move, rotate, scale.
    order: i64,
}

fn placed(uv: Register, placing: Placing, b: &mut Builder) -> Compiled<Register> {
    let Placing { pivot, scale, rotate, offset, order } = placing;
    let mut p = b.binary(F::Subtract, uv, pivot)?;
    if order == 0 {
        p = b.binary(F::Divide, p, scale)?;
        p = rotated(p, rotate, -1.0, b)?;
        p = b.binary(F::Subtract, p, offset)?;
    } else {
        p = b.binary(F::Subtract, p, offset)?;
        p = rotated(p, rotate, -1.0, b)?;
        p = b.binary(F::Divide, p, scale)?;
    }
    Ok(b.binary(F::Add, p, pivot)?)
}

/// Turned by `degrees`, counter-clockwise for the sign 1.
fn rotated(p: Register, degrees: Register, sign: f32, b: &mut Builder) -> Compiled<Register> {
    let radians = b.number(sign * std::f32::consts::PI / 180.0)?;
    let angle = b.binary(F::Multiply, degrees, radians)?;
    let [sin, cos] = [b.unary(F::Sin, angle)?, b.unary(F::Cos, angle)?];
    let zero = b.number(0.0)?;
    let minus_sin = b.binary(F::Subtract, zero, sin)?;
    let rows = [b.combine([cos, minus_sin, zero, zero])?, b.combine([sin, cos, zero, zero])?];
    let [x, y] = [b.binary(F::Dot(2), p, rows[0])?, b.binary(F::Dot(2), p, rows[1])?];
    Ok(b.combine([x, y, zero, zero])?)
}

/// A node that looks no image up.
fn computed(
    inputs: &Inputs<'_>,
    id: &str,
    output: &str,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    let plain = id.strip_prefix("ND_").unwrap_or(id);
    if let Some(suffix) = plain.strip_prefix("UsdPrimvarReader_") {
        let width = reader_width(suffix).or_else(|| width(suffix));
        let (Some(width), Some(name)) = (width, inputs.text("varname")) else {
            return inputs.unknown(format!("the node '{id}' without a name"));
        };
        let fallback = inputs.given("fallback", b)?;
        return primvar(name, width, fallback, b, resources);
    }
    if plain.starts_with("UsdTransform2d") {
        let uv = inputs.number("in", 0.0, b)?;
        let [scale, rotation] = [inputs.number("scale", 1.0, b)?, inputs.number("rotation", 0.0, b)?];
        let translation = inputs.number("translation", 0.0, b)?;
        let scaled = b.binary(F::Multiply, uv, scale)?;
        let turned = rotated(scaled, rotation, 1.0, b)?;
        return Ok(b.binary(F::Add, turned, translation)?);
    }
    if plain.starts_with("UsdUVTexture") || matches!(id, "arnold:image") {
        // It names no image.
        let fallback = inputs.or("fallback", [0.0, 0.0, 0.0, 1.0], b)?;
        return channel(fallback, output, b);
    }
    if id.starts_with("MayaND_fileTexture_") {
        return maya_file(inputs, b);
    }
    match id.strip_prefix("ND_") {
        Some(rest) => materialx(inputs, rest, output, b, resources),
        None => inputs.unknown(format!("the node '{id}'")),
    }
}

/// A normal in the frame of the surface's tangents, −1 to 1: what is made of it stays there.
fn normal_map(inputs: &Inputs<'_>, variant: &str, b: &mut Builder) -> Compiled<Register> {
    if let Some(space) = inputs.text("space").filter(|&space| space != "tangent") {
        return inputs.unknown(format!("a normal map in {space} space"));
    }
    let texel = inputs.or("in", [0.5, 0.5, 1.0, 0.0], b)?;
    let (normal, scale) = (signed(texel, b)?, inputs.number("scale", 1.0, b)?);
    let x = b.swizzle(scale, "x")?;
    let y = if variant == "vector2" { b.swizzle(scale, "y")? } else { x };
    let one = b.number(1.0)?;
    let scale = b.combine([x, y, one, one])?;
    Ok(b.binary(F::Multiply, normal, scale)?)
}

/// 2x − 1
fn signed(texel: Register, b: &mut Builder) -> Compiled<Register> {
    let (two, one) = (b.number(2.0)?, b.number(1.0)?);
    let twice = b.binary(F::Multiply, texel, two)?;
    Ok(b.binary(F::Subtract, twice, one)?)
}

/// What maya-usd writes behind an image: gain and offset of a Maya file node.
fn maya_file(inputs: &Inputs<'_>, b: &mut Builder) -> Compiled<Register> {
    const READ: [&str; 5] = ["inColor", "uvCoord", "defaultColor", "colorGain", "colorOffset"];
    if let Some(name) =
        inputs.node.inputs.keys().chain(inputs.node.connected.keys()).find(|n| !READ.contains(&n.as_str()))
    {
        return inputs.unknown(format!("inputs:{name} of the node '{}'", inputs.node.id));
    }
    let color = inputs.number("inColor", 0.5, b)?;
    let [gain, offset] = [inputs.number("colorGain", 1.0, b)?, inputs.number("colorOffset", 0.0, b)?];
    let scaled = b.binary(F::Multiply, color, gain)?;
    Ok(b.binary(F::Add, scaled, offset)?)
}

/// The nodes of MaterialX; `rest` is the identifier without `ND_`.
fn materialx(
    inputs: &Inputs<'_>,
    rest: &str,
    output: &str,
    b: &mut Builder,
    resources: &mut Resources<'_>,
) -> Compiled<Register> {
    let (category, variant) = rest.split_once('_').unwrap_or((rest, ""));
    // `mix_color3_color3`, `convert_float_color3`: the output's type stands last; `add_color3FA`: with a suffix for the
    // types of inputs.
    let last = variant.rsplit('_').next().unwrap_or_default();
    let kind = last.trim_end_matches(['A', 'B', 'C', 'F', 'I', 'V']);
    let suffix = &last[kind.len()..];
    if category == "normalmap" {
        return normal_map(inputs, variant, b);
    }
    let Some(width) = width(kind) else { return inputs.unknown(format!("the node 'ND_{rest}'")) };

    let unary = |function, b: &mut Builder| {
        let a = inputs.number("in", 0.0, b)?;
        Ok(b.unary(function, a)?)
    };
    let binary = |function, default, b: &mut Builder| {
        let [a, c] = [inputs.number("in1", 0.0, b)?, inputs.number("in2", default, b)?];
        Ok(b.binary(function, a, c)?)
    };
    match category {
        "image" | "tiledimage" => inputs.or("default", [0.0; 4], b),
        "texcoord" => default_uv(inputs.integer("index", 0), b, resources),
        "geomcolor" => primvar("displayColor", width, None, b, resources),
        "geompropvalue" | "geompropvalueuniform" => {
            let Some(name) = inputs.text("geomprop") else { return inputs.unknown("the name of a primvar") };
            let fallback = inputs.given("default", b)?;
            primvar(name, width, fallback, b, resources)
        }
        "constant" => inputs.number("value", 0.0, b),
        "dot" => inputs.number("in", 0.0, b),
        "add" => binary(F::Add, 0.0, b),
        "subtract" => binary(F::Subtract, 0.0, b),
        "multiply" => binary(F::Multiply, 1.0, b),
        "divide" => binary(F::Divide, 1.0, b),
        "modulo" => binary(F::Modulo, 1.0, b),
        "power" => binary(F::Power, 1.0, b),
        "safepower" => binary(F::SafePower, 1.0, b),
        "min" => binary(F::Min, 0.0, b),
        "max" => binary(F::Max, 0.0, b),
        "absval" => unary(F::Abs, b),
        "sign" => unary(F::Sign, b),
        "floor" => unary(F::Floor, b),
        "ceil" => unary(F::Ceil, b),
        "round" => unary(F::Round, b),
        "fract" => unary(F::Fract, b),
        "sqrt" => unary(F::Sqrt, b),
        "exp" => unary(F::Exp, b),
        "sin" => unary(F::Sin, b),
        "cos" => unary(F::Cos, b),
        "rgbtohsv" => unary(F::HsvFromRgb, b),
        "hsvtorgb" => unary(F::RgbFromHsv, b),
        "ln" => {
            let a = inputs.number("in", 1.0, b)?;
            Ok(b.unary(F::Ln, a)?)
        }
        "invert" => {
            let [amount, a] = [inputs.number("amount", 1.0, b)?, inputs.number("in", 0.0, b)?];
            Ok(b.binary(F::Subtract, amount, a)?)
        }
        "clamp" => {
            let [low, high] = [inputs.number("low", 0.0, b)?, inputs.number("high", 1.0, b)?];
            let a = inputs.number("in", 0.0, b)?;
            Ok(b.ternary(F::Clamp, a, low, high)?)
        }
        "smoothstep" => {
            let [low, high] = [inputs.number("low", 0.0, b)?, inputs.number("high", 1.0, b)?];
            let a = inputs.number("in", 0.0, b)?;
            Ok(b.ternary(F::Smoothstep, a, low, high)?)
        }
        "mix" => {
            let [fg, bg] = [inputs.number("fg", 0.0, b)?, inputs.number("bg", 0.0, b)?];
            let mix = inputs.number("mix", 0.0, b)?;
            Ok(b.ternary(F::Mix, fg, bg, mix)?)
        }
        "plus" | "minus" | "difference" | "screen" => composited(inputs, category, b),
        "remap" => {
            let a = inputs.number("in", 0.0, b)?;
            remapped(inputs, a, b)
        }
        "range" => {
            let [low, high] = [inputs.number("inlow", 0.0, b)?, inputs.number("inhigh", 1.0, b)?];
            let a = inputs.number("in", 0.0, b)?;
            let (a, span) = (b.binary(F::Subtract, a, low)?, b.binary(F::Subtract, high, low)?);
            let [one, gamma] = [b.number(1.0)?, inputs.number("gamma", 1.0, b)?];
            let (a, exponent) = (b.binary(F::Divide, a, span)?, b.binary(F::Divide, one, gamma)?);
            let a = b.binary(F::SafePower, a, exponent)?;
            let [low, high] = [inputs.number("outlow", 0.0, b)?, inputs.number("outhigh", 1.0, b)?];
            let span = b.binary(F::Subtract, high, low)?;
            let a = b.binary(F::Multiply, a, span)?;
            let a = b.binary(F::Add, a, low)?;
            let clamped = b.ternary(F::Clamp, a, low, high)?;
            let is_clamped = inputs.number("doclamp", 0.0, b)?;
            Ok(b.ternary(F::Select, clamped, a, is_clamped)?)
        }
        "contrast" => {
            let [amount, pivot] = [inputs.number("amount", 1.0, b)?, inputs.number("pivot", 0.5, b)?];
            let a = inputs.number("in", 0.0, b)?;
            let a = b.binary(F::Subtract, a, pivot)?;
            let a = b.binary(F::Multiply, a, amount)?;
            Ok(b.binary(F::Add, a, pivot)?)
        }
        "luminance" => luminance(inputs, b),
        "saturate" => {
            let [grey, amount] = [luminance(inputs, b)?, inputs.number("amount", 1.0, b)?];
            let a = inputs.number("in", 0.0, b)?;
            Ok(b.ternary(F::Mix, a, grey, amount)?)
        }
        "hsvadjust" => {
            let a = inputs.number("in", 0.0, b)?;
            let amount = inputs.or("amount", [0.0, 1.0, 1.0, 0.0], b)?;
            let hsv = b.unary(F::HsvFromRgb, a)?;
            let shift = b.swizzle(amount, "x000")?;
            let factor = b.swizzle(amount, "1yz1")?;
            let hsv = b.binary(F::Add, hsv, shift)?;
            let hsv = b.binary(F::Multiply, hsv, factor)?;
            Ok(b.unary(F::RgbFromHsv, hsv)?)
        }
        "dotproduct" | "magnitude" => {
            let [a, c] = match category {
                "dotproduct" => [inputs.number("in1", 0.0, b)?, inputs.number("in2", 0.0, b)?],
                _ => [inputs.number("in", 0.0, b)?; 2],
            };
            // The type is that of what goes in.
            let parts = self::width(variant.split('_').next().unwrap_or_default()).unwrap_or(3);
            let dot = b.binary(F::Dot(parts as u8), a, c)?;
            Ok(if category == "magnitude" { b.unary(F::Sqrt, dot)? } else { dot })
        }
        "place2d" => {
            let uv = match inputs.given("texcoord", b)? {
                Some(uv) => uv,
                None => default_uv(0, b, resources)?,
            };
            let placing = Placing {
                pivot: inputs.number("pivot", 0.0, b)?,
                scale: inputs.number("scale", 1.0, b)?,
                rotate: inputs.number("rotate", 0.0, b)?,
                offset: inputs.number("offset", 0.0, b)?,
                order: inputs.integer("operationorder", 0),
            };
            placed(uv, placing, b)
        }
        "rotate2d" => {
            let [p, amount] = [inputs.number("in", 0.0, b)?, inputs.number("amount", 0.0, b)?];
            rotated(p, amount, -1.0, b)
        }
        "ifgreater" | "ifgreatereq" | "ifequal" => {
            let default = if category == "ifequal" { 0.0 } else { 1.0 };
            let [a, c] = [inputs.number("value1", default, b)?, inputs.number("value2", 0.0, b)?];
            let function = match category {
                "ifgreater" => F::Greater,
                "ifgreatereq" => F::GreaterOrEqual,
                _ => F::Equal,
            };
            let holds = b.binary(function, a, c)?;
            if kind == "boolean" {
                return Ok(holds);
            }
            let [yes, no] = [inputs.number("in1", 0.0, b)?, inputs.number("in2", 0.0, b)?];
            Ok(b.ternary(F::Select, yes, no, holds)?)
        }
        "switch" => {
            let which = inputs.number("which", 0.0, b)?;
            let mut chosen = b.number(0.0)?;
            for k in (1..=10).rev() {
                let limit = b.number(k as f32)?;
                let is_below = b.binary(F::Greater, limit, which)?;
                let branch = inputs.number(&format!("in{k}"), 0.0, b)?;
                chosen = b.ternary(F::Select, branch, chosen, is_below)?;
            }
            Ok(chosen)
        }
        _ => rearranged(inputs, category, [variant, kind, suffix], output, b),
    }
}

fn composited(inputs: &Inputs<'_>, category: &str, b: &mut Builder) -> Compiled<Register> {
    let [fg, bg] = [inputs.number("fg", 0.0, b)?, inputs.number("bg", 0.0, b)?];
    let result = match category {
        "plus" => b.binary(F::Add, bg, fg)?,
        "minus" => b.binary(F::Subtract, bg, fg)?,
        "difference" => {
            let difference = b.binary(F::Subtract, bg, fg)?;
            b.unary(F::Abs, difference)?
        }
        _ => {
            let (sum, product) = (b.binary(F::Add, fg, bg)?, b.binary(F::Multiply, fg, bg)?);
            b.binary(F::Subtract, sum, product)?
        }
    };
    let mix = inputs.number("mix", 1.0, b)?;
    Ok(b.ternary(F::Mix, result, bg, mix)?)
}

/// outlow + (a − inlow) (outhigh − outlow) / (inhigh − inlow)
fn remapped(inputs: &Inputs<'_>, a: Register, b: &mut Builder) -> Compiled<Register> {
    let [in_low, in_high] = [inputs.number("inlow", 0.0, b)?, inputs.number("inhigh", 1.0, b)?];
    let [out_low, out_high] = [inputs.number("outlow", 0.0, b)?, inputs.number("outhigh", 1.0, b)?];
    let (from, to) = (b.binary(F::Subtract, in_high, in_low)?, b.binary(F::Subtract, out_high, out_low)?);
    let a = b.binary(F::Subtract, a, in_low)?;
    let a = b.binary(F::Multiply, a, to)?;
    let a = b.binary(F::Divide, a, from)?;
    Ok(b.binary(F::Add, out_low, a)?)
}

/// ACES AP1's unless the node says otherwise; alpha stays.
fn luminance(inputs: &Inputs<'_>, b: &mut Builder) -> Compiled<Register> {
    let a = inputs.number("in", 0.0, b)?;
    let weights = inputs.or("lumacoeffs", [0.272_228_7, 0.674_081_8, 0.053_689_5, 0.0], b)?;
    let grey = b.binary(F::Dot(3), a, weights)?;
    let alpha = b.swizzle(a, "w")?;
    Ok(b.combine([grey, grey, grey, alpha])?)
}

/// Nodes that rearrange components.
fn rearranged(
    inputs: &Inputs<'_>,
    category: &str,
    [variant, kind, suffix]: [&str; 3],
    output: &str,
    b: &mut Builder,
) -> Compiled<Register> {
    match category {
        "combine2" | "combine3" | "combine4" if suffix.is_empty() => {
            let mut parts = [b.number(0.0)?; 4];
            let count = usize::from(category.as_bytes()[7] - b'0');
            for (k, part) in parts.iter_mut().enumerate().take(count) {
                *part = inputs.number(&format!("in{}", k + 1), 0.0, b)?;
            }
            Ok(b.combine(parts)?)
        }
        // CF and VF are three components and a number, VV two and two.
        "combine2" => {
            let [first, second] = [inputs.number("in1", 0.0, b)?, inputs.number("in2", 0.0, b)?];
            let of = |register, name: &str, b: &mut Builder| b.swizzle(register, name);
            let (x, y) = (of(first, "x", b)?, of(first, "y", b)?);
            let (z, w) = match suffix {
                "VV" => (of(second, "x", b)?, of(second, "y", b)?),
                _ => (of(first, "z", b)?, second),
            };
            Ok(b.combine([x, y, z, w])?)
        }
        "separate2" | "separate3" | "separate4" => {
            let a = inputs.number("in", 0.0, b)?;
            channel(a, output, b)
        }
        "extract" => {
            let a = inputs.number("in", 0.0, b)?;
            match inputs.integer("index", 0) {
                k @ 0..=3 => Ok(b.swizzle(a, ["x", "y", "z", "w"][k as usize])?),
                k => inputs.unknown(format!("component {k}")),
            }
        }
        "swizzle" => {
            let a = inputs.number("in", 0.0, b)?;
            let channels = inputs.text("channels").unwrap_or("");
            if channels.is_empty() || channels.len() > 4 || !channels.chars().all(|c| "rgbaxyzw01".contains(c)) {
                return inputs.unknown(format!("the channels '{channels}'"));
            }
            let last = channels.chars().last().unwrap_or('x');
            let pattern: String = channels.chars().chain(std::iter::repeat(last)).take(4).collect();
            Ok(b.swizzle(a, &pattern)?)
        }
        "convert" => {
            let a = inputs.number("in", 0.0, b)?;
            let from = width(variant.split('_').next().unwrap_or_default());
            Ok(match (from, width(kind)) {
                // One number is in all places already; vectors are cut, or filled up with 0 and, in the fourth place, 1.
                (Some(2), Some(3 | 4)) => b.swizzle(a, "xy01")?,
                (Some(3), Some(4)) => b.swizzle(a, "xyz1")?,
                (Some(2..), Some(1)) => b.swizzle(a, "x")?,
                _ => a,
            })
        }
        _ => inputs.unknown(format!("the node 'ND_{category}_{variant}'")),
    }
}
