//! `--scale-from`: two points and their distance, and where the points lie.

use glam::{DVec2, DVec3};
use litetex_exporters::{SplatAsset, rounded};
use litetex_gs::camera::Camera;
use litetex_gs::capture::Capture;
use litetex_gs::console::Log;
use litetex_gs::run::{Scale, Trained};
use litetex_gs::text::{counted, quoted};
use litetex_gs::verify::BakedScene;
use litetex_gs::views::ViewSource as _;
use litetex_gs::{Result, usage};

/// Smallest angle between two rays that tells a depth, degrees: at 1, an error of a pixel moves the point by a tenth of its depth
/// in a photo of 600 pixels focal length.
const ANGLE_MIN_DEG: f64 = 1.0;

/// Digits of lengths in messages.
const DIGITS_SHOWN: usize = 6;
/// Largest distance of a triangulated point from what was marked, as a share of the image's longer side. A choice (measured in the
/// test below: marks 3 pixels off in images of 800 pixels are all taken, of pairs that show different points 22 %).
const MISS_MAX: f64 = 0.02;

/// What `--scale-from` asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum ScaleFrom {
    /// To forget the scale of a run.
    None,
    /// Two points with their distance in metres, and the text itself.
    Distance(Box<[Point; 2]>, f64, String),
}

/// A point of the scene.
#[derive(Clone, Debug, PartialEq)]
pub enum Point {
    /// What pixels of one or two photos show.
    Marked(Vec<(String, [f64; 2])>),
    /// A place in the capture's frame.
    InCapture([f64; 3]),
}

/// Reads the value of the option.
///
/// # Errors
/// What was found and what was expected.
pub fn parse_scale_from(text: &str) -> Result<ScaleFrom, String> {
    if text == "none" {
        return Ok(ScaleFrom::None);
    }
    let expected = "expected two points and their distance, such as 'A.jpg:10,20 A.jpg:300,40 = 1.2m'; a point is VIEW:x,y, \
                    VIEW:x,y+VIEW:x,y or X,Y,Z; 'none' forgets the scale of a run";
    let (points, length) = text.rsplit_once('=').ok_or_else(|| format!("{text:?} has no '=': {expected}"))?;
    let metres = parse_length(length.trim())?;
    let points = parse_points(points).ok_or_else(|| format!("{points:?}: {expected}"))?;
    let points: [Point; 2] = points
        .try_into()
        .map_err(|found: Vec<Point>| format!("{}: {expected}", counted(found.len(), "point")))?;
    if points[0] == points[1] {
        return Err(format!("{text:?}: both points are the same; choose two that are far from each other"));
    }
    Ok(ScaleFrom::Distance(Box::new(points), metres, text.to_owned()))
}

/// A length with its unit, in metres.
fn parse_length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("in", 0.0254), ("ft", 0.3048)];
    let ends = text.find(|c: char| c.is_ascii_alphabetic() && c != 'e').unwrap_or(text.len());
    let (number, unit) = text.split_at(ends);
    let expected = "expected a length with a unit, mm, cm, m, in or ft, such as 1.2m";
    let factor = units.iter().find(|(name, _)| *name == unit).map(|(_, factor)| factor);
    let factor = factor.ok_or_else(|| format!("unit {unit:?} of {text:?}: {expected}"))?;
    let number: f64 = number.trim().parse().map_err(|_| format!("{text:?}: {expected}"))?;
    let metres = number * factor;
    if metres.is_normal() && metres > 0.0 {
        Ok(metres)
    } else {
        Err(format!("{text:?}: the distance must be above 0 and finite"))
    }
}

/// Points, each up to the blank behind its coordinates: names of views may hold blanks, colons and plus signs.
fn parse_points(text: &str) -> Option<Vec<Point>> {
    let (mut points, mut marks, mut rest) = (Vec::new(), Vec::new(), text.trim());
    while !rest.is_empty() {
        let until = rest.find(char::is_whitespace).unwrap_or(rest.len());
        if let Some(place) = numbers::<3>(&rest[..until]).filter(|_| marks.is_empty()) {
            points.push(Point::InCapture(place));
            rest = rest[until..].trim_start();
            continue;
        }
        let (name, pixel, behind) = first_mark(rest)?;
        marks.push((name.to_owned(), pixel));
        match behind.strip_prefix('+') {
            Some(more) => rest = more,
            None => {
                points.push(Point::Marked(std::mem::take(&mut marks)));
                rest = behind.trim_start();
            }
        }
    }
    let sound = marks.is_empty() && points.iter().all(|p| !matches!(p, Point::Marked(m) if m.len() > 2));
    sound.then_some(points)
}

/// The first `VIEW:x,y` of a text: its name, its pixel, and what follows.
fn first_mark(text: &str) -> Option<(&str, [f64; 2], &str)> {
    text.match_indices(':').find_map(|(colon, _)| {
        let behind = &text[colon + 1..];
        let end = behind.find(|c: char| c.is_whitespace() || c == '+').unwrap_or(behind.len());
        let name = &text[..colon];
        numbers::<2>(&behind[..end]).filter(|_| !name.is_empty()).map(|pixel| (name, pixel, &behind[end..]))
    })
}

fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let all: Option<Vec<f64>> =
        text.split(',').map(|v| v.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    all?.try_into().ok()
}

/// Measures the scale of a scene. Marked points need the run with its capture.
///
/// # Errors
/// [`litetex_gs::Error::Usage`] for points that show no place; what opening the capture reports.
pub fn measure(
    (points, metres, text): (&[Point; 2], f64, &str),
    (scene, trained): (&BakedScene, Option<&Trained>),
    log: &Log,
) -> Result<Scale> {
    let is_marked = points.iter().any(|point| matches!(point, Point::Marked(_)));
    let capture = match (is_marked, trained) {
        (false, _) => None,
        (true, Some(trained)) => Some(trained.open_capture(None)?),
        (true, None) => {
            let path = scene.path.display();
            return Err(usage!(
                "--scale-from: {path} knows no photos; name the run, or points as X,Y,Z of the capture's frame"
            ));
        }
    };
    let place = |point: &Point| match (point, &capture) {
        (Point::Marked(marks), Some(capture)) => {
            let found = marked(marks, capture, &scene.asset, log)?;
            let frame = &scene.asset.capture_from_local;
            Ok(frame.transform_point(found.as_vec3().to_array()))
        }
        (Point::InCapture(place), _) => Ok(*place),
        (Point::Marked(_), None) => Err(usage!("--scale-from: no photos")),
    };
    let scale = Scale::of(text, [place(&points[0])?, place(&points[1])?], metres)?;
    let [a, b] = scale.points_in_capture.map(DVec3::from);
    let (units, factor) = (a.distance(b), scale.metres_per_unit);
    let detail = detail(&scene.asset);
    if units < detail {
        return Err(usage!(
            "--scale-from: the points are {units:.3e} units apart, less than the detail of the scene ({detail:.3e}); choose two that \
             are far from each other"
        ));
    }
    let (units, factor) = (rounded(units, DIGITS_SHOWN), rounded(factor, DIGITS_SHOWN));
    let noun = if units == 1.0 { "unit" } else { "units" };
    log.info(&format!("the points are {units} {noun} of the capture apart: a unit is {factor} m"));
    Ok(scale)
}

/// Size of what the scene can tell apart, units of the capture: the median texel, or without textures the median of the splats'
/// smaller standard deviations.
fn detail(asset: &SplatAsset) -> f64 {
    let textured = asset.maps.iter().filter(|map| map.rows > 0).map(|map| map.texel_sizes);
    let mut sizes: Vec<f32> = textured.map(|[u, v]| u.min(v)).collect();
    if sizes.is_empty() {
        sizes = asset.scales.iter().map(|[u, v]| u.min(*v)).collect();
    }
    sizes.sort_by(f32::total_cmp);
    sizes.get(sizes.len() / 2).map_or(0.0, |size| f64::from(*size) * asset.capture_from_local.scale)
}

/// A ray through a marked pixel, local frame, and the camera and position that it belongs to.
struct Ray {
    origin: DVec3,
    direction: DVec3,
    camera: Camera,
    at_px: DVec2,
}

/// Where the point lies that pixels show, local frame.
fn marked(marks: &[(String, [f64; 2])], capture: &Capture, asset: &SplatAsset, log: &Log) -> Result<DVec3> {
    let rays: Vec<Ray> = marks.iter().map(|mark| ray(mark, capture)).collect::<Result<_>>()?;
    let names: Vec<String> = marks.iter().map(|(name, [x, y])| format!("{name}:{x},{y}")).collect();
    let names = names.join("+");
    match &rays[..] {
        [a, b] => triangulated(a, b, &names, log),
        [ray, ..] => {
            let depth =
                asset.surface_along(ray.origin.to_array(), ray.direction.to_array(), asset.near.into());
            let depth = depth.ok_or_else(|| {
                usage!("--scale-from: {names} shows the background, no surface; mark another point, or this one in two views")
            })?;
            Ok(ray.origin + depth * ray.direction)
        }
        [] => Err(usage!("--scale-from: a point without a view")),
    }
}

fn ray((name, pixel): &(String, [f64; 2]), capture: &Capture) -> Result<Ray> {
    let view = (0..capture.num_views()).find(|&v| capture.name(v) == name).ok_or_else(|| {
        let some: Vec<String> = (0..capture.num_views()).take(5).map(|v| quoted(capture.name(v))).collect();
        let (name, views) = (quoted(name), capture.num_views());
        usage!(
            "--scale-from: the capture has no view {name} among its {views}, which are such as {}",
            some.join(", ")
        )
    })?;
    let camera = capture.camera(view);
    let at_px = capture.image_px(view, *pixel)?;
    let local_from_camera = camera.camera_from_local.inverse();
    let direction = local_from_camera.rotation * camera.pinhole.direction_in_camera(at_px);
    Ok(Ray { origin: local_from_camera.translation, direction, camera, at_px })
}

/// The point nearest to two rays.
fn triangulated(a: &Ray, b: &Ray, names: &str, log: &Log) -> Result<DVec3> {
    let (u, v) = (a.direction.normalize(), b.direction.normalize());
    let across = u.cross(v);
    let angle = across.length().atan2(u.dot(v)).to_degrees();
    if angle < ANGLE_MIN_DEG || across.length_squared() == 0.0 {
        return Err(usage!(
            "--scale-from: the rays of {names} are nearly parallel ({angle:.2} degrees, at least {ANGLE_MIN_DEG} are needed); \
             choose views taken from places further apart"
        ));
    }
    let between = b.origin - a.origin;
    let along_a = between.cross(v).dot(across) / across.length_squared();
    let along_b = between.cross(u).dot(across) / across.length_squared();
    let point = 0.5 * (a.origin + along_a * u + b.origin + along_b * v);
    let miss = |ray: &Ray| {
        let seen = ray.camera.pinhole.project(ray.camera.camera_from_local.transform_point(point));
        seen.map_or(f64::INFINITY, |seen| seen.distance(ray.at_px))
    };
    let longer = f64::from(a.camera.pinhole.width_px.max(a.camera.pinhole.height_px));
    let residual_px = miss(a).max(miss(b));
    if along_a <= 0.0 || along_b <= 0.0 || residual_px > MISS_MAX * longer {
        return Err(usage!(
            "--scale-from: the rays of {names} miss each other (by {residual_px:.1} pixels of the training images, at most {:.1} are \
             allowed); mark the same point in both views",
            MISS_MAX * longer
        ));
    }
    log.info(&format!("{names}: triangulated at {angle:.1} degrees, {residual_px:.2} pixels off"));
    Ok(point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use litetex_gs::camera::{Pinhole, RigidTransform};

    #[test]
    fn points_and_lengths_are_parsed() {
        let mark = |name: &str, x, y| (name.to_owned(), [x, y]);
        let parsed = |text: &str| match parse_scale_from(text).unwrap() {
            ScaleFrom::Distance(points, metres, _) => (*points, metres),
            ScaleFrom::None => panic!("{text}"),
        };
        let one =
            [Point::Marked(vec![mark("A b.jpg", 1.0, 2.5)]), Point::Marked(vec![mark("A b.jpg", 30.0, 4.0)])];
        assert_eq!(parsed("A b.jpg:1,2.5 A b.jpg:30,4 = 1.20m"), (one, 1.2));
        let two = [
            Point::Marked(vec![mark("a", 1.0, 2.0), mark("b+c.png", 3.0, 4.0)]),
            Point::InCapture([-1.0, 2.0, 3e-2]),
        ];
        assert_eq!(parsed("a:1,2+b+c.png:3,4 -1,2,3e-2 = 5 cm"), (two, 0.05));
        for (length, metres) in [("12in", 0.3048), ("1ft", 0.3048), ("10 mm", 0.01), ("1e1m", 10.0)] {
            assert!((parsed(&format!("a:1,2 a:3,4={length}")).1 - metres).abs() < 1e-12, "{length}");
        }
        assert_eq!(parse_scale_from("none"), Ok(ScaleFrom::None));
        for (wrong, part) in [
            ("a:1,2 a:3,4", "no '='"),
            ("a:1,2 = 1m", "1 point:"),
            ("a:1,2 a:3,4 a:5,6 = 1m", "3 points"),
            ("a:1,2 a:1,2 = 1m", "same"),
            ("a:1,2 a:3 = 1m", "VIEW:x,y"),
            ("a:1,2+b:1,2+c:1,2 a:3,4 = 1m", "VIEW:x,y"),
            ("a:1,2 a:3,4 = 0m", "above 0"),
            ("a:1,2 a:3,4 = -1m", "above 0"),
            ("a:1,2 a:3,4 = 1", "mm, cm, m, in or ft"),
            ("a:1,2 a:3,4 = 1metre", "mm, cm, m, in or ft"),
            ("a:1,2 a:3,4 = m", "such as 1.2m"),
        ] {
            let error = parse_scale_from(wrong).unwrap_err();
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }

    /// Numbers evenly in [-1, 1), always the same ones.
    fn noise() -> impl FnMut() -> f64 {
        let mut state = 1_u64;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }

    #[test]
    fn marks_a_few_pixels_off_are_taken_and_those_of_other_points_mostly_not() {
        let log = Log::new(litetex_gs::console::LogFormat::Text, true, 0);
        let (width_px, height_px, focal_px) = (800, 600, 600.0);
        let pinhole =
            Pinhole { width_px, height_px, fx_px: focal_px, fy_px: focal_px, cx_px: 400.0, cy_px: 300.0 };
        // Cameras on an arc around a point 5 units away, 20 degrees apart.
        let camera = |angle: f64| {
            let rotation = DMat3::from_rotation_y(angle.to_radians());
            let translation = DVec3::new(0.0, 0.0, 5.0);
            Camera { pinhole, camera_from_local: RigidTransform { rotation, translation } }
        };
        let cameras = [camera(0.0), camera(20.0)];
        let seen = |c: usize, point: DVec3| {
            pinhole.project(cameras[c].camera_from_local.transform_point(point)).unwrap()
        };
        let ray = |c: usize, at_px: DVec2| {
            let local_from_camera = cameras[c].camera_from_local.inverse();
            let direction = local_from_camera.rotation * pinhole.direction_in_camera(at_px);
            Ray { origin: local_from_camera.translation, direction, camera: cameras[c], at_px }
        };
        let mut next = noise();
        let mut point = || DVec3::new(next(), next(), next());
        for error_px in [0.0, 0.5, 1.0, 3.0] {
            for _ in 0..500 {
                let (p, a, b) = (point(), point().truncate() * error_px, point().truncate() * error_px);
                let rays = [ray(0, seen(0, p) + a), ray(1, seen(1, p) + b)];
                let found = triangulated(&rays[0], &rays[1], "p", &log).unwrap();
                // Depth errs by Z^2 / (f b) for each pixel of parallax: Z is up to 6.4, b 1.74, and both marks may be off.
                let off = found.distance(p);
                assert!(off < 1e-9 + 0.08 * error_px, "{error_px} px: {off}");
            }
        }
        // Negative control: two points for one. Those on one epipolar line no check can tell apart.
        let taken = (0..500).filter(|_| {
            let (p, q) = (point(), point());
            triangulated(&ray(0, seen(0, p)), &ray(1, seen(1, q)), "p", &log).is_ok()
        });
        let taken = taken.count();
        // Measured: 110.
        assert!(taken < 150, "{taken} of 500");
    }
}
