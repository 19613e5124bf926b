//! The XML of Agisoft Metashape and PhotoScan ("Export Cameras"): sensors, components and cameras of a chunk.
//!
//! The transform of a camera is `chunk_from_camera`, 4 x 4 by rows, of a camera with x to the right, y down and z forward.
//! Its component, or else the chunk, may have a similarity `capture_from_chunk`: rotation by rows, translation and scale.
//! Of an export with geographic coordinates the capture is geocentric (ECEF). All this follows from a published export of
//! a survey flight (the test below), whose photos state where they were taken: read as here, the camera is 4 cm from
//! there and looks down; with rows for columns it is 190 m away. In local coordinates z is up; without a similarity the
//! chunk's axes are arbitrary. Lenses are in `metashape_lens.rs`.
//!
//! Geocentric coordinates are in metres. Local ones have the unit that the chunk's reference states, which is a metre also of
//! chunks whose size nobody measured: they count as metric if places or scale bars determine the similarity.

use super::axes::{from_opencv, from_rows};
use super::lookup::{begins_with_all, files, find as find_photo, largest, photo_folder};
use super::metashape_lens::lens;
use super::unused;
use super::xml::{self, child, numbers, text_of};
use crate::camera::RigidTransform;
use crate::capture::folder::CaptureFolder;
use crate::capture::left_out::LeftOut;
use crate::capture::lens::Lens;
use crate::capture::pose_format::{Found, PoseFormat};
use crate::capture::source::{Source, SourceView, Why};
use crate::text::quoted;
use crate::{Report, Result};
use glam::{DMat3, DVec3};
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// See [`PoseFormat`].
pub(crate) const FORMAT: PoseFormat = PoseFormat {
    name: "metashape",
    help: "XML export of cameras from Agisoft Metashape",
    files: "Metashape's cameras (.xml)",
    has_observations: false,
    find,
};

/// Distances from the centre of the earth, in metres, at which coordinates are taken to be geocentric.
const NEAR_EARTH_M: std::ops::Range<f64> = 6.3e6..6.45e6;

/// Squared ratio of the earth's axes (WGS84), for the normal of the ellipsoid.
const AXES_RATIO_2: f64 = 1.006_739_496_742_276_5;

/// Places that determine a similarity.
const NUM_PLACES_MIN: usize = 3;

fn find(path: &Path, report: &mut Report) -> Option<Found> {
    let is_xml = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("xml"));
    let (root, candidates) = match path.is_file() {
        true if !is_xml => return None,
        true => (path.parent().unwrap_or(Path::new("")), vec![path.to_owned()]),
        false => (path, files(path, "xml", 0)),
    };
    let exports = candidates.into_iter().filter(|p| begins_with_all(p, &["<document", "<chunk"])).collect();
    let file = largest(exports, num_cameras, report)?;
    Some(Found::new(root, Box::new(move |folder| read(&file, folder))))
}

/// The posed cameras of the chunk that is read of a file; 0 of a file that cannot be read.
fn num_cameras(path: &Path) -> usize {
    let count = || {
        let text = xml::read(path)?;
        let document = xml::parse(path, &text)?;
        largest_chunk(path, document.root_element(), &mut Report::default()).map(|chunk| num_posed(&chunk))
    };
    count().unwrap_or(0)
}

/// A similarity: `in_capture = rotation * scale * in_chunk + translation`.
struct Placement {
    rotation: DMat3,
    translation: DVec3,
    scale: f64,
}

impl Placement {
    /// From an element with `rotation`, `translation` and `scale`, each of which may be missing.
    fn of(transform: Node<'_, '_>) -> Result<Self, String> {
        let text =
            |name: &str, default: &'static str| child(transform, name).map_or(default, text_of).to_owned();
        let named = |name: &'static str| move |what: String| format!("{name} of a transform: {what}");
        let rotation = numbers::<9>(&text("rotation", "1 0 0 0 1 0 0 0 1")).map_err(named("rotation"))?;
        let translation = numbers::<3>(&text("translation", "0 0 0")).map_err(named("translation"))?;
        let [scale] = numbers::<1>(&text("scale", "1")).map_err(named("scale"))?;
        if scale <= 0.0 {
            return Err(format!("the scale of a transform is {scale}"));
        }
        Ok(Self {
            rotation: DMat3::from_cols_array(&rotation).transpose(),
            translation: translation.into(),
            scale,
        })
    }
}

/// A placement, or what is wrong with it.
type Stated = Result<Placement, String>;

/// A chunk, whose cameras were aligned together, and its parts by their ids.
struct Chunk<'a, 'input> {
    sensors: BTreeMap<&'a str, Node<'a, 'input>>,
    components: BTreeMap<&'a str, Option<Stated>>,
    /// Of cameras whose component has none.
    placement: Option<Stated>,
    is_local: bool,
    /// Whether local coordinates are in metres, by what was measured on the ground.
    is_metric_local: bool,
    cameras: Vec<Node<'a, 'input>>,
    /// Of the photos, by the ids of their cameras; exports state none, projects do.
    paths: BTreeMap<&'a str, &'a str>,
}

impl<'a, 'input> Chunk<'a, 'input> {
    fn of(chunk: Node<'a, 'input>) -> Self {
        let by_id = |parent: &str, name: &'static str| {
            let nodes = child(chunk, parent).into_iter().flat_map(|p| p.descendants());
            nodes.filter(move |n| n.has_tag_name(name)).map(|n| (n.attribute("id").unwrap_or_default(), n))
        };
        let placement = |node: Node<'_, '_>| child(node, "transform").map(Placement::of);
        Self {
            sensors: by_id("sensors", "sensor").collect(),
            components: by_id("components", "component")
                .map(|(id, component)| (id, placement(component)))
                .collect(),
            placement: placement(chunk),
            is_local: local_system(chunk).is_some(),
            is_metric_local: local_system(chunk).is_some_and(is_in_metres) && is_measured(chunk),
            cameras: by_id("cameras", "camera").map(|(_, camera)| camera).collect(),
            paths: chunk.descendants().filter_map(photo_path).collect(),
        }
    }

    /// What names the photo of a camera: its path where it is stated, or else the label.
    fn name_of_photo(&self, camera: Node<'a, 'input>) -> &'a str {
        let path = camera.attribute("id").and_then(|id| self.paths.get(id).copied());
        path.unwrap_or(camera.attribute("label").unwrap_or_default())
    }

    fn placement(&self, camera: Node<'_, '_>) -> Option<&Stated> {
        let own = camera.attribute("component_id").and_then(|id| self.components.get(id));
        own.and_then(Option::as_ref).or(self.placement.as_ref())
    }

    /// Cameras that are aligned with each other: all whose components are placed in the capture, or else the largest
    /// component.
    fn aligned(&self) -> Vec<Node<'a, 'input>> {
        let posed = || self.cameras.iter().copied().filter(|c| child(*c, "transform").is_some());
        let mut unplaced = BTreeMap::<&str, usize>::new();
        for camera in posed().filter(|c| self.placement(*c).is_none()) {
            *unplaced.entry(camera.attribute("component_id").unwrap_or_default()).or_default() += 1;
        }
        let num_placed = posed().count() - unplaced.values().sum::<usize>();
        // Of equals, the first.
        let largest =
            unplaced.iter().rev().max_by_key(|(_, count)| **count).filter(|(_, count)| **count > num_placed);
        posed()
            .filter(|c| match largest {
                Some((id, _)) => {
                    self.placement(*c).is_none() && c.attribute("component_id").unwrap_or_default() == *id
                }
                None => self.placement(*c).is_some(),
            })
            .collect()
    }

    fn pose(&self, camera: Node<'_, '_>) -> Result<RigidTransform, String> {
        let m = numbers::<16>(child(camera, "transform").map_or("", text_of))
            .map_err(|e| format!("its transform: {e}"))?;
        let axes = from_rows([[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]]);
        let centre = DVec3::new(m[3], m[7], m[11]);
        match self.placement(camera) {
            Some(Err(problem)) => Err(problem.clone()),
            Some(Ok(Placement { rotation, translation, scale })) => {
                from_opencv(*rotation * axes, *rotation * (centre * *scale) + *translation)
            }
            None => from_opencv(axes, centre),
        }
    }

    /// The direction that the coordinates of the capture state as up, and whether they are in metres.
    fn up_and_metric(&self, views: &[SourceView]) -> (Option<DVec3>, bool) {
        let is_placed = self.placement.is_some() || self.components.values().any(Option::is_some);
        if views.is_empty() || !is_placed {
            return (None, false);
        }
        let centres = views.iter().map(|v| v.camera_from_capture.origin_of_a_in_b());
        let centre = centres.sum::<DVec3>() / views.len() as f64;
        if !self.is_local && NEAR_EARTH_M.contains(&centre.length()) {
            let normal = DVec3::new(centre.x, centre.y, centre.z * AXES_RATIO_2);
            return (Some(normal.normalize()), true);
        }
        (Some(DVec3::Z), self.is_metric_local)
    }
}

fn read(path: &Path, folder: &CaptureFolder) -> Result<Source> {
    let text = xml::read(path)?;
    let document = xml::parse(path, &text)?;
    let mut source = Source::at(path);
    let chunk = Chunk::of(largest_chunk(path, document.root_element(), &mut source.report)?);
    let photos = photo_folder(folder, &["images"]);
    let mut left_out = LeftOut::default();
    let mut lenses = BTreeMap::<&str, Result<Lens, String>>::new();
    let aligned: BTreeSet<usize> = chunk.aligned().iter().map(|c| c.id().get_usize()).collect();
    let mut num_of_name = BTreeMap::<&str, usize>::new();
    let is_used = |c: &&Node<'_, '_>| aligned.contains(&c.id().get_usize()) && !is_disabled(**c);
    for &camera in chunk.cameras.iter().filter(is_used) {
        *num_of_name.entry(chunk.name_of_photo(camera)).or_default() += 1;
    }
    for &camera in &chunk.cameras {
        let label = camera.attribute("label").unwrap_or_default();
        if child(camera, "transform").is_none() {
            source.leave_out(label, Why::NoPose);
            continue;
        }
        if is_disabled(camera) {
            source.leave_out(label, Why::Disabled);
            continue;
        }
        if !aligned.contains(&camera.id().get_usize()) {
            source.leave_out(label, Why::Apart);
            continue;
        }
        let named = chunk.name_of_photo(camera);
        if num_of_name[named] > 1 {
            let element = format!("camera {} ({})", camera.attribute("id").unwrap_or("?"), quoted(named));
            left_out.push_view(
                element,
                named,
                format!(
                    "{} cameras have this label, and no path says whose photo it is; rename them",
                    num_of_name[named]
                ),
            );
            continue;
        }
        let id = camera.attribute("sensor_id").unwrap_or_default();
        if !lenses.contains_key(id) {
            let lens = match chunk.sensors.get(id) {
                Some(sensor) => lens(path, *sensor, &mut source.report)?,
                None => Err(format!("it refers to sensor {}, which is not there", quoted(id))),
            };
            lenses.insert(id, lens);
        }
        let usable = chunk.pose(camera).and_then(|pose| Ok((pose, lenses[id].clone()?)));
        let (camera_from_capture, lens) = match usable {
            Ok(usable) => usable,
            Err(what) => {
                left_out.push_view(format!("camera {}", quoted(label)), label, what);
                continue;
            }
        };
        let Some((name, photo)) = find_photo(&photos, named)? else {
            source.leave_out(named, Why::NoPhoto);
            continue;
        };
        source.views.push(SourceView::new(name, photo, lens, camera_from_capture));
    }
    let num_apart = source.names_unused(Why::Apart).len();
    if num_apart > 0 {
        let what = format!(
            "left out {} in other components than the largest: align them in Metashape",
            crate::text::counted(num_apart, "camera")
        );
        source.report.warn("cameras-in-other-components", num_apart, what);
    }
    let total = source.num_posed() + left_out.count();
    left_out.finish_views(path, total, &mut source)?;
    unused::report(&mut source);
    let (up, is_metric) = chunk.up_and_metric(&source.views);
    source.stated_up = up;
    source.metric = is_metric.then_some("Metashape");
    Ok(source)
}

/// The system of local coordinates that a chunk is in, as WKT.
fn local_system<'a>(chunk: Node<'a, '_>) -> Option<&'a str> {
    child(chunk, "reference").map(text_of).filter(|text| text.starts_with("LOCAL_CS"))
}

/// Whether the first unit of a system is a metre; it may be a millimetre.
fn is_in_metres(system: &str) -> bool {
    let unit = system.split_once("UNIT[").map_or("", |(_, unit)| unit);
    unit.split([',', ']']).nth(1).and_then(litetex_exporters::parse_number) == Some(1.0)
}

/// Whether what was measured determines the size of a chunk: places of three cameras or markers, or the length of a scale bar.
/// No published export with a scale bar was at hand: one that is written otherwise leaves the scale unknown.
fn is_measured(chunk: Node<'_, '_>) -> bool {
    let references = || {
        let all = chunk.descendants().filter(|n| n.has_tag_name("reference"));
        all.filter(|n| !is_disabled(*n) && !n.parent().is_some_and(is_disabled))
    };
    let number = |n: &Node<'_, '_>, name: &str| {
        n.attribute(name).and_then(litetex_exporters::parse_number).filter(|v| v.is_finite())
    };
    let is_place = |n: &Node<'_, '_>| ["x", "y", "z"].iter().all(|axis| number(n, axis).is_some());
    let is_bar = |n: &Node<'_, '_>| {
        number(n, "distance").is_some_and(|d| d > 0.0) && n.ancestors().any(|a| a.has_tag_name("scalebar"))
    };
    references().filter(is_place).count() >= NUM_PLACES_MIN || references().any(|n| is_bar(&n))
}

fn is_disabled(camera: Node<'_, '_>) -> bool {
    matches!(camera.attribute("enabled"), Some("false" | "0"))
}

/// The path of a photo, and the id of its camera: `camera` or, in the frame of a project, what refers to one.
fn photo_path<'a>(photo: Node<'a, '_>) -> Option<(&'a str, &'a str)> {
    let camera = photo.parent().filter(|_| photo.has_tag_name("photo"))?;
    let id = camera.attribute("camera_id").or(camera.attribute("id"))?;
    photo.attribute("path").filter(|path| !path.is_empty()).map(|path| (id, path))
}

fn num_posed(chunk: &Node<'_, '_>) -> usize {
    chunk.descendants().filter(|n| n.has_tag_name("camera") && child(*n, "transform").is_some()).count()
}

/// The chunk with the most posed cameras.
fn largest_chunk<'a, 'input>(
    path: &Path,
    root: Node<'a, 'input>,
    report: &mut Report,
) -> Result<Node<'a, 'input>> {
    let chunks: Vec<_> =
        root.children().filter(|n| n.has_tag_name("chunk")).map(|n| (num_posed(&n), n)).collect();
    // Of equals, the first.
    let Some((count, largest)) = chunks.iter().rev().max_by_key(|(count, _)| *count) else {
        return Err(invalid!(path, "no chunk; expected the XML that Metashape writes with Export Cameras"));
    };
    let others = chunks.iter().filter(|(count, n)| n != largest && *count > 0).count();
    if others > 0 {
        let label = quoted(largest.attribute("label").unwrap_or_default());
        let what = format!("{others} other chunks are not used; {label} has the most cameras ({count})");
        report.warn("several-chunks", others, what);
    }
    Ok(*largest)
}

#[cfg(test)]
#[path = "metashape_tests.rs"]
mod tests;
