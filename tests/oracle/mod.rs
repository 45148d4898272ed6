//! The independent judge of the calculus: re-traces in multi-precision that share no code with the product.
//!
//! [`chain`] describes a ray's fate in plain numbers; [`trace`] follows it with 102 digits from Snell's law and the
//! reflection law alone, without a single derivative formula; [`derivative`] differentiates that by central
//! differences and measures how the result reacts to rounding; [`subject`] runs the product over the same chain in
//! `f64`; [`judge`] compares the two; [`cases`] holds the named chains and [`random`] draws others.
//!
//! # The chain's condition number
//!
//! An `f64` program that rounds every quantity once solves a slightly wrong problem exactly. How far that moves a
//! derivative v is measured, not estimated: the oracle runs again with *every* input and *every* intermediate of the
//! chain (surface parameters, hit points, coefficients of the dispersion laws and their n) changed by about u of its
//! size, and every direction and normal turned by about u, with u = 2⁻⁸⁰ and fixed random factors, and differentiates
//! that chain. Directions are turned by u·n(λ) as well, because K and K' ⊇ n'd are rounded separately. The reaction
//! |v_u − v| / u is the largest over a few draws. With it
//!
//! ```text
//! cond(v) = max(1, |v_u − v| / (u |v|)),        error bound = tolerance · cond(v) · |v| = tolerance · max(|v|, |v_u − v| / u)
//! ```
//!
//! The second form needs no division and so also judges derivatives that vanish (an achromatic deflector).

#![allow(dead_code, unreachable_pub, reason = "each test program uses a part of the shared support")]

pub mod cases;
pub mod chain;
pub mod derivative;
pub mod judge;
pub mod random;
pub mod real;
pub mod subject;
pub mod trace;
