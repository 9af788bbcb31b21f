//! Pictures of a few spheres, looked at pixel by pixel.
