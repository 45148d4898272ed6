//! The Python extension `abbe._core`: a thin border over the core.
