//! Arithmetic that keeps its digits.

pub mod compensated;
pub mod piecewise;
pub mod trig;
