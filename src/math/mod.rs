//! Arithmetic that keeps its digits.
