//! The calculus: how a ray moves with the screen and with the wavelength.
