//! The light tree.
