//! What is computed for a pixel; the plug-in point.
