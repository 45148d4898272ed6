//! The scene: its description, the checks, the compiled form.

pub mod description;
