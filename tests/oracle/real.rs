//! Real numbers with 102 decimal digits, and vectors of them.
//!
//! Binary floating point of `dashu-float` with one fixed precision, so that every `f64` enters exactly. The oracle
//! differentiates by central differences; with a step h = 2⁻¹⁰⁰ and 340 bits, a second difference keeps 140 bits of
//! the function's own size and its truncation error is about h² ≈ 10⁻⁶⁰: both far below anything an `f64` shows.

use dashu_float::{Context, Repr, round::mode::HalfEven};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Bits of every result.
pub const PRECISION: usize = 340;

const CONTEXT: Context<HalfEven> = Context::new(PRECISION);

/// A binary floating-point number of [`PRECISION`] bits.
#[derive(Clone, Debug)]
pub struct Real(Repr<2>);

impl Real {
    /// An `f64`, exactly.
    pub fn new(value: f64) -> Self {
        Self(Repr::try_from(value).expect("the oracle takes finite numbers only"))
    }

    pub fn zero() -> Self {
        Self(Repr::zero())
    }

    pub fn one() -> Self {
        Self(Repr::one())
    }

    /// 2ᵉ.
    pub fn power_of_two(exponent: isize) -> Self {
        Self(Repr::new(1.into(), exponent))
    }

    pub fn sqrt(&self) -> Self {
        Self(CONTEXT.sqrt(&self.0).expect("square root of a negative number").value().into_repr())
    }

    pub fn abs(&self) -> Self {
        if self.is_negative() { -self } else { self.clone() }
    }

    pub fn is_negative(&self) -> bool {
        self.0.significand() < &0.into()
    }

    pub fn is_zero(&self) -> bool {
        self.0.significand() == &0.into()
    }

    pub fn to_f64(&self) -> f64 {
        self.0.to_f64().value()
    }

    pub fn max(self, other: Self) -> Self {
        if (&self - &other).is_negative() { other } else { self }
    }
}

macro_rules! operator {
    ($trait:ident, $method:ident) => {
        impl $trait<&Real> for &Real {
            type Output = Real;
            fn $method(self, other: &Real) -> Real {
                Real(CONTEXT.$method(&self.0, &other.0).expect("finite operands").value().into_repr())
            }
        }
        impl $trait<Real> for &Real {
            type Output = Real;
            fn $method(self, other: Real) -> Real {
                self.$method(&other)
            }
        }
        impl $trait<&Real> for Real {
            type Output = Real;
            fn $method(self, other: &Real) -> Real {
                (&self).$method(other)
            }
        }
        impl $trait<Real> for Real {
            type Output = Real;
            fn $method(self, other: Real) -> Real {
                (&self).$method(&other)
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl Neg for &Real {
    type Output = Real;
    fn neg(self) -> Real {
        Real(-self.0.clone())
    }
}

impl Neg for Real {
    type Output = Real;
    fn neg(self) -> Real {
        Real(-self.0)
    }
}

/// Three reals.
#[derive(Clone, Debug)]
pub struct Vector(pub [Real; 3]);

impl Vector {
    pub fn new(v: [f64; 3]) -> Self {
        Self(v.map(Real::new))
    }

    pub fn zero() -> Self {
        Self(std::array::from_fn(|_| Real::zero()))
    }

    pub fn dot(&self, other: &Self) -> Real {
        let [a, b, c] = [0, 1, 2].map(|i| &self.0[i] * &other.0[i]);
        a + b + c
    }

    pub fn cross(&self, other: &Self) -> Self {
        let (a, b) = (&self.0, &other.0);
        let c = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
        Self([c(1, 2), c(2, 0), c(0, 1)])
    }

    pub fn scale(&self, factor: &Real) -> Self {
        Self([0, 1, 2].map(|i| &self.0[i] * factor))
    }

    pub fn length(&self) -> Real {
        self.dot(self).sqrt()
    }

    pub fn unit(&self) -> Self {
        self.scale(&(Real::one() / self.length()))
    }

    pub fn to_f64(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.0[i].to_f64())
    }
}

impl Add<&Vector> for &Vector {
    type Output = Vector;
    fn add(self, other: &Vector) -> Vector {
        Vector([0, 1, 2].map(|i| &self.0[i] + &other.0[i]))
    }
}

impl Sub<&Vector> for &Vector {
    type Output = Vector;
    fn sub(self, other: &Vector) -> Vector {
        Vector([0, 1, 2].map(|i| &self.0[i] - &other.0[i]))
    }
}

impl Neg for &Vector {
    type Output = Vector;
    fn neg(self) -> Vector {
        Vector([0, 1, 2].map(|i| -&self.0[i]))
    }
}
