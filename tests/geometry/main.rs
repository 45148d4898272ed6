//! Laws of the geometry: what is hit does not depend on trees, scales or luck.

mod departures;
mod hits;
mod meshes;
mod shapes;
mod solids;
mod surfaces;
