//! The camera that photos share.

/// Photos of one camera, with one lens and size.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Focal length, pixels, if the EXIF data say it.
    pub focal_px: Option<f64>,
    pub size: (u32, u32),
    /// All photos of the folder if empty.
    pub names: Vec<String>,
}
