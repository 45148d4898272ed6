//! Where in the pixel samples are taken.
