//! Where camera rays begin, and how they move with the pixel.
