//! What can make a capture hard, one thing at a time: names, levels and what each changes.

use super::levels::{Kinds, Leveled, Row};
use serde::{Deserialize, Serialize};

/// What is changed in a capture. Test photos and their poses stay clean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StressKind {
    /// Nothing: the control.
    None,
    /// Gaussian noise on the training photos.
    Noise,
    /// The poster is a checkerboard.
    Checker,
    /// Upright wires in front of the back wall.
    Wires,
    /// Another number of training photos.
    Views,
    /// The poster is a mirror.
    Mirror,
    /// Exposure and white balance drift between the training photos.
    Exposure,
    /// The written rotations of the training photos are off by a little.
    PoseNoise,
    /// The written poses of a few training photos are wrong.
    WrongPoses,
    /// The written frame is moved.
    Offset,
    /// The written frame is scaled.
    Scale,
    /// The written frame is rotated.
    Turn,
    /// A share of the sparse points lies anywhere.
    Outliers,
    /// A share of the sparse points is there twice.
    Duplicates,
    /// Sparse points at the centres of cameras.
    CameraPoints,
    /// Test photos from another distance; from farther away they are as much smaller.
    Distance,
    /// Test photos at another resolution.
    Resolution,
    /// Training photos are cropped to different sizes.
    Sizes,
    /// As sizes, with black pixels and a mask where the others are cropped.
    SizesPadded,
    /// The principal point of the training photos is off their centre.
    OffCentre,
    /// As off-centre, padded and masked until the principal point is in the centre.
    OffCentrePadded,
    /// Pixels of the training photos are not square.
    Anisotropic,
    /// All photos are taken from one point.
    Coincident,
    /// All photos look in one direction.
    Parallel,
    /// Cameras so low that they see the floor edge-on.
    Grazing,
    /// Low walls under a sky without sparse points; the test photos are at the ends of the arc.
    Sky,
    /// A figure walks through every fifth training photo.
    Walker,
    /// Two crossing cards, and as test photos a video around them.
    Cards,
}

use StressKind as Kind;

impl Kinds for Kind {
    const WORD: &'static str = "stress";
    const ROWS: &'static [Row<Kind>] = &[
        (Kind::None, "none", 0.0, [0.0, 0.0], ""),
        (Kind::Noise, "noise", 10.0, [0.0, 100.0], "standard deviation, of 255"),
        (Kind::Checker, "checker", 6.0, [1.0, 50.0], "period, pixels of a typical view"),
        (Kind::Wires, "wires", 1.0, [0.1, 20.0], "thickness, pixels of a typical view"),
        (Kind::Views, "views", 9.0, [1.0, 1000.0], "training photos"),
        (Kind::Mirror, "mirror", 0.0, [0.0, 0.0], ""),
        (Kind::Exposure, "exposure", 0.5, [0.0, 3.0], "largest change, stops"),
        (Kind::PoseNoise, "pose-noise", 0.3, [0.0, 20.0], "standard deviation, degrees"),
        (Kind::WrongPoses, "wrong-poses", 0.05, [0.0, 0.5], "share of the training photos"),
        (Kind::Offset, "offset", 1e6, [0.0, 1e9], "metres"),
        (Kind::Scale, "scale", 1e-3, [1e-9, 1e9], "factor"),
        (Kind::Turn, "turn", 37.0, [-180.0, 180.0], "degrees"),
        (Kind::Outliers, "outliers", 0.3, [0.0, 1.0], "share of the points"),
        (Kind::Duplicates, "duplicates", 0.3, [0.0, 1.0], "share of the points"),
        (Kind::CameraPoints, "camera-points", 10.0, [0.0, 1000.0], "points"),
        (Kind::Distance, "distance", 3.0, [0.3, 10.0], "factor"),
        (Kind::Resolution, "resolution", 2.0, [0.1, 8.0], "factor"),
        (Kind::Sizes, "sizes", 0.0, [0.0, 0.0], ""),
        (Kind::SizesPadded, "sizes-padded", 0.0, [0.0, 0.0], ""),
        (Kind::OffCentre, "off-centre", 0.2, [0.0, 0.45], "share of the width"),
        (Kind::OffCentrePadded, "off-centre-padded", 0.2, [0.0, 0.45], "share of the width"),
        (Kind::Anisotropic, "anisotropic", 1.25, [0.5, 2.0], "width of the image per width of the view"),
        (Kind::Coincident, "coincident", 0.0, [0.0, 0.0], ""),
        (Kind::Parallel, "parallel", 0.0, [0.0, 0.0], ""),
        (Kind::Grazing, "grazing", 2.0, [0.5, 10.0], "elevation, degrees"),
        (Kind::Sky, "sky", 0.0, [0.0, 0.0], ""),
        (Kind::Walker, "walker", 0.0, [0.0, 0.0], ""),
        (Kind::Cards, "cards", 120.0, [2.0, 1000.0], "frames of the video"),
    ];
}

/// What is changed, and by how much.
pub type Stress = Leveled<StressKind>;
