//! A material's input as a short list of operations, one after the other, without jumps: what a shading network comes to.
//!
//! Every register holds four numbers: a colour with alpha, a vector, or one number in all four places. Operations only
//! refer to registers before them, so that a program ends, and there are at most [`MAX_OPERATIONS`]. What follows from
//! constants is computed when the program is built. Arithmetic is in f32 with the functions of `libm`, so that programs
//! give the same bits everywhere.

use super::sample::{Images, Lookup};
use super::store::Store;

/// The longest program.
pub const MAX_OPERATIONS: usize = 256;
/// The longest bundle of programs.
const MAX_BUNDLED: usize = 1024;
/// The most results of a bundle.
pub const MAX_RESULTS: usize = 40;
/// The most operations of all programs of one builder.
const MAX_ALL: usize = 4096;

/// The result of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Register(u16);

/// A program would be longer than [`MAX_OPERATIONS`], or all of a builder together too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

/// What is computed of registers, component by component unless it says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// |x|
    Abs,
    /// −1, 0 or 1
    Sign,
    /// ⌊x⌋
    Floor,
    /// ⌈x⌉
    Ceil,
    /// To the nearest integer, halves away from 0.
    Round,
    /// x − ⌊x⌋
    Fract,
    /// √x
    Sqrt,
    /// eˣ
    Exp,
    /// ln x
    Ln,
    /// sin x
    Sin,
    /// cos x
    Cos,
    /// Hue, saturation, value of the colour.
    HsvFromRgb,
    /// The colour of hue, saturation, value.
    RgbFromHsv,
    /// a + b
    Add,
    /// a − b
    Subtract,
    /// a b
    Multiply,
    /// a / b
    Divide,
    /// a − b ⌊a/b⌋
    Modulo,
    /// aᵇ
    Power,
    /// sgn(a) |a|ᵇ
    SafePower,
    /// The lesser.
    Min,
    /// The greater.
    Max,
    /// 1 where a > b, else 0.
    Greater,
    /// 1 where a ≥ b, else 0.
    GreaterOrEqual,
    /// 1 where a = b, else 0.
    Equal,
    /// a·b of the first two, three or four components, in all places.
    Dot(u8),
    /// b (1 − c) + a c
    Mix,
    /// min(max(a, b), c)
    Clamp,
    /// 0 up to b, 1 from c, t² (3 − 2t) of a between.
    Smoothstep,
    /// a where c is not 0, else b.
    Select,
}

/// Where a component of a swizzle comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lane {
    Of(u8),
    Zero,
    One,
}

#[derive(Clone, Debug, PartialEq)]
enum Operation {
    Constant([f32; 4]),
    /// The primvar with a number, or the register where there is none.
    Primvar(u32, Register),
    /// An image at texture coordinates, or the register where there is none.
    Texture(u32, Register, Register),
    Swizzle(Register, [Lane; 4]),
    /// The first component of each.
    Combine([Register; 4]),
    Function(Function, [Register; 3]),
}

/// Puts programs together. Registers of one builder may be shared by the programs that it makes.
#[derive(Debug, Default)]
pub struct Builder {
    operations: Vec<Operation>,
    lookups: Vec<Lookup>,
}

impl Builder {
    /// Four numbers.
    pub fn constant(&mut self, value: [f32; 4]) -> Result<Register, TooLarge> {
        self.push(Operation::Constant(value))
    }

    /// One number in all places.
    pub fn number(&mut self, value: f32) -> Result<Register, TooLarge> {
        self.constant([value; 4])
    }

    /// The primvar with a number; `fallback` where the geometry has none.
    pub fn primvar(&mut self, number: u32, fallback: Register) -> Result<Register, TooLarge> {
        self.push(Operation::Primvar(number, fallback))
    }

    /// An image at the texture coordinates `uv`; `fallback` where there is none.
    pub fn texture(&mut self, lookup: Lookup, uv: Register, fallback: Register) -> Result<Register, TooLarge> {
        let known = self.lookups.iter().position(|other| *other == lookup);
        let number = known.unwrap_or_else(|| {
            self.lookups.push(lookup);
            self.lookups.len() - 1
        });
        self.push(Operation::Texture(number as u32, uv, fallback))
    }

    /// Components by name: `x y z w` or `r g b a`, `0` and `1`; one name for all four.
    ///
    /// # Panics
    ///
    /// Where `pattern` is neither one nor four such names.
    pub fn swizzle(&mut self, of: Register, pattern: &str) -> Result<Register, TooLarge> {
        let lane = |name: char| match name {
            '0' => Lane::Zero,
            '1' => Lane::One,
            'x' | 'r' => Lane::Of(0),
            'y' | 'g' => Lane::Of(1),
            'z' | 'b' => Lane::Of(2),
            'w' | 'a' => Lane::Of(3),
            other => panic!("'{other}' is no component"),
        };
        let lanes: Vec<_> = pattern.chars().map(lane).collect();
        let lanes = match lanes[..] {
            [all] => [all; 4],
            [x, y, z, w] => [x, y, z, w],
            _ => panic!("'{pattern}' is neither one component nor four"),
        };
        self.fold(Operation::Swizzle(of, lanes), &[of])
    }

    /// The first component of each.
    pub fn combine(&mut self, of: [Register; 4]) -> Result<Register, TooLarge> {
        self.fold(Operation::Combine(of), &of)
    }

    /// A function of one register.
    pub fn unary(&mut self, function: Function, a: Register) -> Result<Register, TooLarge> {
        self.ternary(function, a, a, a)
    }

    /// A function of two.
    pub fn binary(&mut self, function: Function, a: Register, b: Register) -> Result<Register, TooLarge> {
        self.ternary(function, a, b, b)
    }

    /// A function of three.
    pub fn ternary(&mut self, function: Function, a: Register, b: Register, c: Register) -> Result<Register, TooLarge> {
        self.fold(Operation::Function(function, [a, b, c]), &[a, b, c])
    }

    /// The value of a register that is a constant.
    pub fn value(&self, register: Register) -> Option<[f32; 4]> {
        match self.operations[usize::from(register.0)] {
            Operation::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// The program whose result is `root`: what it needs of the operations, and no more.
    pub fn program(&self, root: Register) -> Result<Program, TooLarge> {
        let Bundle { operations, lookups, .. } = self.needed(&[root]);
        if operations.len() > MAX_OPERATIONS { Err(TooLarge) } else { Ok(Program { operations, lookups }) }
    }

    /// The programs of several registers in one, what they share computed once.
    pub fn bundle(&self, roots: &[Register]) -> Result<Bundle, TooLarge> {
        let bundle = self.needed(roots);
        let fits = bundle.operations.len() <= MAX_BUNDLED && roots.len() <= MAX_RESULTS;
        if fits { Ok(bundle) } else { Err(TooLarge) }
    }

    /// What `roots` need; of a single one the last operation is its own.
    fn needed(&self, roots: &[Register]) -> Bundle {
        let end = roots.iter().map(|root| usize::from(root.0) + 1).max().unwrap_or(0);
        let mut needed = vec![false; end];
        roots.iter().for_each(|root| needed[usize::from(root.0)] = true);
        for i in (0..end).rev() {
            if needed[i] {
                self.operations[i].operands().for_each(|r| needed[usize::from(r.0)] = true);
            }
        }
        let mut place = vec![Register(0); end];
        let mut lookup_place = vec![None; self.lookups.len()];
        let (mut operations, mut lookups) = (Vec::new(), Vec::new());
        for (i, operation) in self.operations[..end].iter().enumerate().filter(|(i, _)| needed[*i]) {
            let at = |r: Register| place[usize::from(r.0)];
            let moved = match *operation {
                Operation::Constant(value) => Operation::Constant(value),
                Operation::Primvar(number, fallback) => Operation::Primvar(number, at(fallback)),
                Operation::Texture(lookup, uv, fallback) => {
                    let lookup = *lookup_place[lookup as usize].get_or_insert_with(|| {
                        lookups.push(self.lookups[lookup as usize].clone());
                        (lookups.len() - 1) as u32
                    });
                    Operation::Texture(lookup, at(uv), at(fallback))
                }
                Operation::Swizzle(of, lanes) => Operation::Swizzle(at(of), lanes),
                Operation::Combine(of) => Operation::Combine(of.map(at)),
                Operation::Function(function, of) => Operation::Function(function, of.map(at)),
            };
            place[i] = Register(operations.len() as u16);
            operations.push(moved);
        }
        let results = roots.iter().map(|root| place[usize::from(root.0)]).collect();
        Bundle { operations, lookups, results }
    }

    fn push(&mut self, operation: Operation) -> Result<Register, TooLarge> {
        // What stands there already is not computed twice.
        if let Some(known) = self.operations.iter().position(|other| *other == operation) {
            return Ok(Register(known as u16));
        }
        if self.operations.len() == MAX_ALL {
            return Err(TooLarge);
        }
        self.operations.push(operation);
        Ok(Register((self.operations.len() - 1) as u16))
    }

    /// Adds an operation, or its value where its operands are constants.
    fn fold(&mut self, operation: Operation, operands: &[Register]) -> Result<Register, TooLarge> {
        if !operands.iter().all(|&r| self.value(r).is_some()) {
            return self.push(operation);
        }
        let value = operation.value(|r| self.value(r).expect("all operands are constants"));
        self.constant(value)
    }
}

impl Operation {
    fn operands(&self) -> impl Iterator<Item = Register> {
        let list: Vec<Register> = match *self {
            Self::Constant(_) => vec![],
            Self::Primvar(_, fallback) => vec![fallback],
            Self::Texture(_, uv, fallback) => vec![uv, fallback],
            Self::Swizzle(of, _) => vec![of],
            Self::Combine(of) => of.to_vec(),
            Self::Function(_, of) => of.to_vec(),
        };
        list.into_iter()
    }

    /// What follows from operands alone.
    fn value(&self, get: impl Fn(Register) -> [f32; 4]) -> [f32; 4] {
        match *self {
            Self::Constant(value) => value,
            Self::Swizzle(of, lanes) => {
                let from = get(of);
                lanes.map(|lane| match lane {
                    Lane::Of(k) => from[usize::from(k)],
                    Lane::Zero => 0.0,
                    Lane::One => 1.0,
                })
            }
            Self::Combine(of) => of.map(|r| get(r)[0]),
            Self::Function(function, [a, b, c]) => function.apply(get(a), get(b), get(c)),
            Self::Primvar(..) | Self::Texture(..) => unreachable!("needs a surface"),
        }
    }
}

impl Function {
    fn apply(self, a: [f32; 4], b: [f32; 4], c: [f32; 4]) -> [f32; 4] {
        let one = |f: &dyn Fn(f32) -> f32| a.map(f);
        let two = |f: &dyn Fn(f32, f32) -> f32| std::array::from_fn(|k| f(a[k], b[k]));
        let three = |f: &dyn Fn(f32, f32, f32) -> f32| std::array::from_fn(|k| f(a[k], b[k], c[k]));
        let truth = |holds: bool| f32::from(u8::from(holds));
        match self {
            Self::Abs => one(&f32::abs),
            Self::Sign => one(&|x| if x == 0.0 { 0.0 } else { x.signum() }),
            Self::Floor => one(&f32::floor),
            Self::Ceil => one(&f32::ceil),
            Self::Round => one(&|x| (x.abs() + 0.5).floor().copysign(x)),
            Self::Fract => one(&|x| x - x.floor()),
            Self::Sqrt => one(&f32::sqrt),
            Self::Exp => one(&libm::expf),
            Self::Ln => one(&libm::logf),
            Self::Sin => one(&libm::sinf),
            Self::Cos => one(&libm::cosf),
            Self::HsvFromRgb => hsv_from_rgb(a),
            Self::RgbFromHsv => rgb_from_hsv(a),
            Self::Add => two(&|a, b| a + b),
            Self::Subtract => two(&|a, b| a - b),
            Self::Multiply => two(&|a, b| a * b),
            Self::Divide => two(&|a, b| a / b),
            Self::Modulo => two(&|a, b| a - b * (a / b).floor()),
            Self::Power => two(&libm::powf),
            Self::SafePower => two(&|a, b| if a == 0.0 { 0.0 } else { a.signum() * libm::powf(a.abs(), b) }),
            Self::Min => two(&f32::min),
            Self::Max => two(&f32::max),
            Self::Greater => two(&|a, b| truth(a > b)),
            Self::GreaterOrEqual => two(&|a, b| truth(a >= b)),
            #[allow(clippy::float_cmp, reason = "the node is a comparison of floats")]
            Self::Equal => two(&|a, b| truth(a == b)),
            Self::Dot(n) => [(0..usize::from(n)).map(|k| a[k] * b[k]).sum(); 4],
            Self::Mix => three(&|a, b, c| b * (1.0 - c) + a * c),
            Self::Clamp => three(&|x, low, high| x.max(low).min(high)),
            Self::Smoothstep => three(&|x, low, high| {
                if x >= high {
                    1.0
                } else if x <= low {
                    0.0
                } else {
                    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
                    t * t * (3.0 - 2.0 * t)
                }
            }),
            Self::Select => three(&|a, b, c| if c == 0.0 { b } else { a }),
        }
    }
}

/// As the MaterialX library has it: hue in 0..1.
fn hsv_from_rgb([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let (low, high) = (r.min(g).min(b), r.max(g).max(b));
    let delta = high - low;
    let saturation = if high > 0.0 { delta / high } else { 0.0 };
    if saturation <= 0.0 {
        return [0.0, 0.0, high, a];
    }
    let sector = if r >= high {
        (g - b) / delta
    } else if g >= high {
        2.0 + (b - r) / delta
    } else {
        4.0 + (r - g) / delta
    };
    let hue = sector / 6.0;
    [if hue < 0.0 { hue + 1.0 } else { hue }, saturation, high, a]
}

fn rgb_from_hsv([h, s, v, a]: [f32; 4]) -> [f32; 4] {
    if s < 0.0001 {
        return [v, v, v, a];
    }
    let turned = 6.0 * (h - h.floor());
    let sector = turned.floor();
    let f = turned - sector;
    let (p, q, t) = (v * (1.0 - s), v * (1.0 - s * f), v * (1.0 - s * (1.0 - f)));
    let [r, g, b] = match sector as i32 {
        0 => [v, t, p],
        1 => [q, v, p],
        2 => [p, v, t],
        3 => [p, q, v],
        4 => [t, p, v],
        _ => [v, p, q],
    };
    [r, g, b, a]
}

/// A compiled input: its last operation is its value.
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    operations: Vec<Operation>,
    lookups: Vec<Lookup>,
}

impl Program {
    /// The same value everywhere.
    pub fn constant(value: [f32; 4]) -> Self {
        Self { operations: vec![Operation::Constant(value)], lookups: Vec::new() }
    }

    /// The value, if it is the same everywhere.
    pub fn as_constant(&self) -> Option<[f32; 4]> {
        match self.operations[..] {
            [Operation::Constant(value)] => Some(value),
            _ => None,
        }
    }

    /// The numbers of the images that it looks up.
    pub fn images(&self) -> impl Iterator<Item = u32> {
        images(&self.lookups)
    }

    /// The value where `primvar` gives the primvars by their numbers.
    pub fn at(&self, store: &Store, primvar: impl Fn(u32) -> Option<[f32; 4]>) -> [f32; 4] {
        let mut registers = [[0.0; 4]; MAX_OPERATIONS];
        run(&self.operations, &self.lookups, store, primvar, &mut registers);
        registers[self.operations.len() - 1]
    }
}

/// Several compiled inputs that are computed together.
#[derive(Clone, Debug, PartialEq)]
pub struct Bundle {
    operations: Vec<Operation>,
    lookups: Vec<Lookup>,
    results: Vec<Register>,
}

impl Bundle {
    /// How many results there are.
    pub fn len(&self) -> usize {
        self.results.len()
    }

    /// Whether nothing is computed.
    pub fn is_empty(&self) -> bool {
        self.results.is_empty()
    }

    /// The numbers of the images that it looks up.
    pub fn images(&self) -> impl Iterator<Item = u32> {
        images(&self.lookups)
    }

    /// The results, where `primvar` gives the primvars by their numbers; what is beyond them is 0.
    pub fn at(&self, store: &Store, primvar: impl Fn(u32) -> Option<[f32; 4]>) -> [[f32; 4]; MAX_RESULTS] {
        // Registers are cleared before use: short bundles clear few.
        match self.operations.len() {
            0..=64 => self.within::<64>(store, primvar),
            65..=256 => self.within::<256>(store, primvar),
            _ => self.within::<MAX_BUNDLED>(store, primvar),
        }
    }

    fn within<const M: usize>(
        &self,
        store: &Store,
        primvar: impl Fn(u32) -> Option<[f32; 4]>,
    ) -> [[f32; 4]; MAX_RESULTS] {
        let mut registers = [[0.0; 4]; M];
        run(&self.operations, &self.lookups, store, primvar, &mut registers);
        let mut results = [[0.0; 4]; MAX_RESULTS];
        for (result, register) in results.iter_mut().zip(&self.results) {
            *result = registers[usize::from(register.0)];
        }
        results
    }
}

fn images(lookups: &[Lookup]) -> impl Iterator<Item = u32> {
    lookups.iter().flat_map(|lookup| match &lookup.images {
        Images::Single(number) => vec![*number],
        Images::Tiles(tiles) => tiles.iter().map(|tile| tile.1).collect(),
    })
}

fn run(
    operations: &[Operation],
    lookups: &[Lookup],
    store: &Store,
    primvar: impl Fn(u32) -> Option<[f32; 4]>,
    registers: &mut [[f32; 4]],
) {
    for (i, operation) in operations.iter().enumerate() {
        let get = |r: Register| registers[usize::from(r.0)];
        registers[i] = match *operation {
            Operation::Primvar(number, fallback) => primvar(number).unwrap_or_else(|| get(fallback)),
            Operation::Texture(lookup, uv, fallback) => {
                let [u, v, ..] = get(uv);
                lookups[lookup as usize].at(store, [u, v]).unwrap_or_else(|| get(fallback))
            }
            _ => operation.value(get),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_folded_and_what_is_not_needed_is_left_out() {
        let mut builder = Builder::default();
        let two = builder.number(2.0).unwrap();
        let three = builder.number(3.0).unwrap();
        let six = builder.binary(Function::Multiply, two, three).unwrap();
        assert_eq!(builder.program(six).unwrap().as_constant(), Some([6.0; 4]));
        let st = builder.primvar(0, two).unwrap();
        let sum = builder.binary(Function::Add, st, six).unwrap();
        let program = builder.program(sum).unwrap();
        assert_eq!(program.operations.len(), 4, "{program:?}");
        let bits = |value: [f32; 4]| value.map(f32::to_bits);
        let there = program.at(&Store::default(), |_| Some([1.0, 2.0, 0.0, 0.0]));
        assert_eq!(bits(there), bits([7.0, 8.0, 6.0, 6.0]));
        assert_eq!(bits(program.at(&Store::default(), |_| None)), bits([8.0; 4]));
    }

    #[test]
    fn programs_have_an_end() {
        let mut builder = Builder::default();
        let one = builder.number(1.0).unwrap();
        let mut last = builder.primvar(0, one);
        for i in 0..2 * MAX_ALL {
            let Ok(register) = last else { break };
            let number = builder.number(i as f32).unwrap_or(one);
            last = builder.binary(Function::Add, register, number);
            assert_eq!(last.is_ok() && builder.program(last.unwrap()).is_ok(), 2 * i + 4 <= MAX_OPERATIONS);
            if i > MAX_OPERATIONS {
                // Only the length of all counts from here.
                break;
            }
        }
        let all = (0..2 * MAX_ALL).map(|i| builder.number(-(i as f32))).find(Result::is_err);
        assert_eq!(all, Some(Err(TooLarge)));
    }

    #[test]
    fn a_bundle_has_the_results_of_its_programs_and_computes_shared_things_once() {
        let mut builder = Builder::default();
        let zero = builder.number(0.0).unwrap();
        let st = builder.primvar(0, zero).unwrap();
        let root = builder.unary(Function::Sqrt, st).unwrap();
        let two = builder.number(2.0).unwrap();
        let roots = [builder.binary(Function::Multiply, root, two).unwrap(), root];
        let bundle = builder.bundle(&roots).unwrap();
        assert_eq!((bundle.len(), bundle.operations.len()), (2, 5));
        let primvar = |_| Some([4.0, 9.0, 0.0, 1.0]);
        let results = bundle.at(&Store::default(), primvar);
        for (result, root) in results.into_iter().zip(roots) {
            let alone = builder.program(root).unwrap().at(&Store::default(), primvar);
            assert_eq!(result.map(f32::to_bits), alone.map(f32::to_bits));
        }
        assert!(builder.bundle(&[]).unwrap().is_empty());
    }

    #[test]
    fn hue_saturation_value_and_back() {
        for rgb in [[0.2, 0.5, 0.9, 1.0], [0.9, 0.1, 0.3, 0.5], [0.3, 0.3, 0.3, 1.0], [0.1, 0.8, 0.05, 0.0]] {
            let back = rgb_from_hsv(hsv_from_rgb(rgb));
            assert!(back.iter().zip(rgb).all(|(a, b)| (a - b).abs() < 1e-6), "{back:?} {rgb:?}");
        }
    }
}
