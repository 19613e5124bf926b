//! The sidecar files of RealityScan and RealityCapture: an .xmp beside each photo, with the same stem.
//!
//! `xcr:Rotation` is the rotation of `camera_from_capture` by rows (x to the right, y down, z forward) and `xcr:Position`
//! the camera's centre: in the published sidecars (the test below) the first row is level and the second points down, as
//! photos are taken, and the cameras look at the scene; with rows for columns they are not. z is up. `FocalLength35mm`
//! refers to 36 mm along the photo's longer side, `PrincipalPointU` and `V` are offsets from its centre in shares of that
//! side. `DistortionCoeficients` (spelt so) are k1 to k4, t1, t2 of Brown's model on the plane z = 1, with t1, t2 as
//! OpenCV's p1, p2 (as nerfstudio reads the CSV of the same program).

use super::axes::from_rows;
use super::film;
use super::lookup::{begins_with_all, files, name_in, photo_folder};
use super::unused;
use super::xml::{self, numbers, text_of};
use crate::camera::RigidTransform;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::{Distortion, Lens};
use crate::capture::photos::photo_size;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why, checked_pose};
use crate::text::quoted;
use crate::{Error, Report, Result};
use glam::DVec3;
use roxmltree::Node;
use std::path::Path;

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "reality-xmp",
    help: "sidecar files of RealityScan / RealityCapture",
    files: "RealityScan's sidecar files (.xmp)",
    has_observations: false,
    find,
};

/// The namespace of the properties.
const XCR: &str = "http://www.capturingreality.com/ns/xcr/1.1#";

const RDF: &str = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";

/// Levels of folders below that of the photos.
const DEPTH: usize = 2;

fn find(path: &Path, _: &mut Report) -> Option<Found> {
    let is_there = |folder: &Path, depth| files(folder, "xmp", depth).iter().any(|p| is_sidecar(p));
    let found = path.is_dir() && (is_there(path, 0) || is_there(&path.join("images"), DEPTH));
    let sidecars = || [files(path, "xmp", 0), files(&path.join("images"), "xmp", DEPTH)].concat();
    found.then(|| Found { files: sidecars(), ..Found::new(path, Box::new(read)) })
}

/// Sidecars of other programs have no properties of this one.
fn is_sidecar(path: &Path) -> bool {
    begins_with_all(path, &[XCR])
}

fn read(folder: &CaptureFolder) -> Result<Source> {
    let photos = photo_folder(folder, &["images"]);
    let mut source = Source::at(&folder.root);
    source.stated_up = Some(DVec3::Z);
    let mut left_out = LeftOut::default();
    // The photos may have been moved away from their sidecars.
    let images = folder.root.join("images");
    let places = [(photos.path(), DEPTH), (&*images, DEPTH), (&*folder.root, 0)];
    let found = places.map(|(base, depth)| (base, files(base, "xmp", depth)));
    let found = found.into_iter().find(|(_, sidecars)| sidecars.iter().any(|path| is_sidecar(path)));
    let (base, sidecars) = found.unwrap_or((&*folder.root, Vec::new()));
    let mut num_dropped = 0;
    for path in &sidecars {
        // Sidecars of other programs state no pose; one that is broken may be ours.
        if !is_sidecar(path) && is_whole(path) {
            continue;
        }
        let stem = path.with_extension("");
        let stem = stem.strip_prefix(base).unwrap_or(&stem).to_string_lossy().replace('\\', "/");
        let Some(photo) = photos.find(&stem)? else {
            source.leave_out(stem, Why::NoPhoto);
            continue;
        };
        let element = format!("camera {}", quoted(&stem));
        let camera = match camera(path)? {
            Ok(Some(camera)) => camera,
            Ok(None) => {
                source.leave_out(stem, Why::NoPose);
                continue;
            }
            Err(what) => {
                left_out.push_view(element, &stem, what);
                continue;
            }
        };
        num_dropped += usize::from(camera.has_dropped_terms);
        let lens = match camera.lens(photo_size(&photo)?) {
            Ok(lens) => lens,
            Err(what) => {
                left_out.push_view(element, &stem, what);
                continue;
            }
        };
        let name = name_in(&photos, &photo);
        source.views.push(SourceView::new(name, photo, lens, camera.camera_from_capture));
    }
    if num_dropped > 0 {
        let what = format!("skew and aspect ratio of {num_dropped} lenses are not supported and ignored");
        source.report.warn("lens-term-dropped", num_dropped, what);
    }
    let total = source.num_posed() + left_out.count();
    left_out.finish_views(&folder.root, total, &mut source)?;
    unused::report(&mut source);
    Ok(source)
}

/// What a sidecar file states.
struct Camera {
    camera_from_capture: RigidTransform,
    focal_mm: f64,
    /// Offset of the principal point in shares of the longer side.
    principal_point: [f64; 2],
    distortion: Distortion,
    has_dropped_terms: bool,
}

/// The camera of a sidecar file, `None` if it states no pose, or what is wrong with it.
///
/// # Errors
/// [`Error::Unsupported`] for a lens that no photo may have.
fn camera(path: &Path) -> Result<Result<Option<Camera>, String>> {
    let text = match xml::read(path) {
        Ok(text) => text,
        Err(error) => return Ok(Err(what_is_wrong(error))),
    };
    let document = match xml::parse(path, &text) {
        Ok(document) => document,
        Err(error) => return Ok(Err(what_is_wrong(error))),
    };
    let descriptions = || document.descendants().filter(|n| n.has_tag_name((RDF, "Description")));
    let Some(description) = descriptions().find(|n| property(*n, "Rotation").is_some()) else {
        return Ok(Ok(None));
    };
    let model = property(description, "DistortionModel").unwrap_or("perspective");
    let is_brown = model.starts_with("brown");
    if !is_brown && !matches!(model, "none" | "perspective") {
        return Err(unsupported!(
            path,
            "DistortionModel {}; supported: brown3, brown4 (with or without t2), perspective; align again with one of \
             these, or export undistorted photos",
            quoted(model)
        ));
    }
    Ok(of_description(description, is_brown))
}

/// Whether a file is an XML document.
fn is_whole(path: &Path) -> bool {
    xml::read(path).is_ok_and(|text| xml::parse(path, &text).is_ok())
}

/// Without the name of the file, which the stem of the photo tells.
fn what_is_wrong(error: Error) -> String {
    match error {
        Error::InvalidInput { what, .. } | Error::Unsupported { what, .. } => what,
        other => other.to_string(),
    }
}

fn of_description(description: Node<'_, '_>, is_brown: bool) -> Result<Option<Camera>, String> {
    fn values<const N: usize>(node: Node<'_, '_>, name: &str) -> Result<Option<[f64; N]>, String> {
        property(node, name).map(|text| numbers(text).map_err(|e| format!("{name}: {e}"))).transpose()
    }
    let [rotation, position] = ["Rotation", "Position"].map(|name| property(description, name).is_some());
    if !(rotation && position) {
        return Ok(None);
    }
    let r = values::<9>(description, "Rotation")?.unwrap_or_default();
    let rotation = from_rows([[r[0], r[1], r[2]], [r[3], r[4], r[5]], [r[6], r[7], r[8]]]);
    let centre = DVec3::from(values::<3>(description, "Position")?.unwrap_or_default());
    // Checked with the centre, which keeps its size: the translation does as well.
    let pose = checked_pose(rotation, centre)?;
    let camera_from_capture =
        RigidTransform { rotation: pose.rotation, translation: -(pose.rotation * pose.translation) };
    let number = |name: &str| values::<1>(description, name).map(|v| v.map(|[v]| v));
    let coefficients = values::<6>(description, "DistortionCoeficients")?.unwrap_or_default();
    let [k1, k2, k3, k4, t1, t2] = coefficients;
    let distortion = match is_brown && coefficients != [0.0; 6] {
        true => Distortion::Brown { k: [k1, k2, k3, k4], p: [t1, t2], shear: 0.0 },
        false => Distortion::None,
    };
    Ok(Some(Camera {
        camera_from_capture,
        focal_mm: number("FocalLength35mm")?.ok_or("it has no FocalLength35mm")?,
        principal_point: [
            number("PrincipalPointU")?.unwrap_or(0.0),
            number("PrincipalPointV")?.unwrap_or(0.0),
        ],
        distortion,
        has_dropped_terms: number("Skew")?.unwrap_or(0.0) != 0.0
            || number("AspectRatio")?.unwrap_or(1.0) != 1.0,
    }))
}

impl Camera {
    /// The lens at the size of its photo.
    fn lens(&self, size_px: (u32, u32)) -> Result<Lens, String> {
        let pinhole = film::pinhole(self.focal_mm, self.principal_point, size_px);
        let lens = Lens { pinhole, distortion: self.distortion };
        lens.checked()
    }
}

/// A property of RDF: an attribute or an element inside.
fn property<'a>(description: Node<'a, '_>, name: &str) -> Option<&'a str> {
    let element = description.children().find(|c| c.has_tag_name((XCR, name)));
    description.attribute((XCR, name)).or_else(|| element.map(text_of))
}

#[cfg(test)]
#[path = "reality_xmp_tests.rs"]
mod tests;
