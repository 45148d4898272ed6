//! Shapes, instances and the trees over them: what a ray meets, and how the surface is curved there.
