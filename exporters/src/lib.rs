//! Asset formats for textured Gaussian splats.
