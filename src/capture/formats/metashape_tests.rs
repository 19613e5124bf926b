use super::*;
use crate::capture::lens::Distortion;
use crate::capture::{Capture, LoadOptions};
use glam::DVec2;
use tempfile::{TempDir, tempdir};

/// An excerpt of an export of Metashape 2 (a survey flight of a DJI Mavic 3M), published as a test of open-forest-
/// observatory/geograypher.
const SURVEY: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0">
  <chunk label="Chunk 1" enabled="true">
    <sensors next_id="1">
      <sensor id="0" label="M3M (12.29mm)" type="frame">
        <resolution width="5280" height="3956"/>
        <property name="layer_index" value="0"/>
        <calibration type="frame" class="adjusted">
          <resolution width="5280" height="3956"/>
          <f>3705.4728792737214</f>
          <cx>11.6738523909</cx>
          <cy>-27.7497969199</cy>
          <b1>0.5262024073</b1>
          <b2>-0.3058334293</b2>
          <k1>-0.0919367147</k1>
          <k2>-0.0762807468</k2>
          <k3>0.1162639394</k3>
          <k4>-0.0761413904</k4>
          <p1>-0.0003134847</p1>
          <p2>0.0001164035</p2>
        </calibration>
      </sensor>
    </sensors>
    <components next_id="1" active_id="0">
      <component id="0" label="Component 1">
        <transform>
          <rotation locked="true">0.8710699454 0.3070967021 -0.3833128821 -0.4909742007 0.5658364395 -0.6623997719 0.0134716110 0.7651932691 0.6436596744</rotation>
          <translation locked="true">-2499366.429888 -4256836.520906 4029217.965003</translation>
          <scale locked="true">12.354192447331316</scale>
        </transform>
      </component>
    </components>
    <cameras next_id="816" next_group_id="2">
      <group id="0" label="Group 1" type="folder">
        <camera id="0" sensor_id="0" component_id="0" label="/home/user/image_sets/0001/nadir/000001/000001-01/00/000001-01_00001.JPG">
          <transform>-0.99988146 -0.00872749 0.01268391 7.04224697 -0.00842932 0.99969124 0.02337453 7.05403071 -0.01288400 0.02326485 -0.99964631 0.43561421 0 0 0 1</transform>
          <orientation>1</orientation>
          <reference x="-120.417985477" y="39.411917469999999" z="2420.1089999999999" yaw="179.90000000000001" pitch="0.099999999999993788" roll="-0" enabled="true" rotation_enabled="false"/>
        </camera>
      </group>
    </cameras>
  </chunk>
</document>
"#;

/// Reads a document in a folder with these photos.
fn source(xml: &str, photos: &[&str]) -> Result<Source> {
    let folder = tempdir().unwrap();
    for name in photos {
        std::fs::write(folder.path().join(name), b"").unwrap();
    }
    let path = folder.path().join("cameras.xml");
    std::fs::write(&path, xml).unwrap();
    read(&path, &CaptureFolder::new(folder.path(), None, false).unwrap())
}

/// Geocentric position of a longitude, latitude (degrees) and height (m) on WGS84.
fn geocentric(longitude: f64, latitude: f64, height: f64) -> (DVec3, DVec3) {
    let (lon, lat) = (longitude.to_radians(), latitude.to_radians());
    let up = DVec3::new(lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin());
    let flattening = 1.0 / 298.257_223_563;
    let e2 = flattening * (2.0 - flattening);
    let n = 6_378_137.0 / (1.0 - e2 * lat.sin().powi(2)).sqrt();
    ((n + height) * up - DVec3::Z * (n * e2 * lat.sin()), up)
}

#[test]
fn an_export_of_a_survey_flight_puts_the_camera_where_its_photo_was_taken() {
    let source = source(SURVEY, &["000001-01_00001.JPG"]).unwrap();
    let view = &source.views[0];
    assert_eq!(view.name, "000001-01_00001.JPG");
    let (expected, up) = geocentric(-120.417985477, 39.41191747, 2420.109);
    // Measured: 0.04 m; with the rotation by columns 189 m.
    let centre = view.camera_from_capture.origin_of_a_in_b();
    assert!(centre.distance(expected) < 0.1, "{}", centre.distance(expected));
    // The photo was taken straight down, with yaw 180: its lower edge to the north.
    let axes = view.camera_from_capture.rotation.transpose();
    assert!((axes * DVec3::Z).dot(up) < -0.999);
    let north = (DVec3::Z - up * up.z).normalize();
    assert!((axes * DVec3::Y).dot(north) > 0.99);
    assert!(source.stated_up.unwrap().dot(up) > 1.0 - 1e-8);
}

#[test]
fn lenses_follow_the_formulas_of_the_manual() {
    let lens = source(SURVEY, &["000001-01_00001.JPG"]).unwrap().views[0].lens;
    let (x, y) = (0.6_f64, -0.4_f64);
    let r2 = x * x + y * y;
    let (f, b1, b2) = (3705.4728792737214, 0.5262024073, -0.3058334293);
    let (p1, p2) = (-0.0003134847, 0.0001164035);
    let radial = 1.0 - 0.0919367147 * r2 - 0.0762807468 * r2.powi(2) + 0.1162639394 * r2.powi(3)
        - 0.0761413904 * r2.powi(4);
    let xd = x * radial + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y;
    let yd = y * radial + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y;
    let expected = DVec2::new(
        0.5 * 5280.0 + 11.6738523909 + xd * f + xd * b1 + yd * b2,
        0.5 * 3956.0 - 27.7497969199 + yd * f,
    );
    let d = lens.distortion.distort(DVec2::new(x, y));
    let c = lens.pinhole;
    let got = DVec2::new(d.x * c.fx_px + c.cx_px, d.y * c.fy_px + c.cy_px);
    assert!((got - expected).length() < 1e-9, "{got} {expected}");
    // Negative control: OpenCV's order of p1 and p2 is 0.7 px away.
    let Distortion::Brown { k, p, shear } = lens.distortion else { panic!("{lens:?}") };
    let other = Distortion::Brown { k, p: [p[1], p[0]], shear }.distort(DVec2::new(x, y));
    assert!((other - d).length() * f > 0.5);
}

#[test]
fn old_calibrations_count_from_the_corner() {
    // The sensor of an export of PhotoScan 1.2 (hollydinkel/astrobeecd).
    let old = "<resolution width='1280' height='960'/><fx>603.78877</fx><fy>602.11334</fy><cx>575.92329</cx><cy>495.30887</cy>";
    let text =
        small("", &format!("<calibration type='frame' class='adjusted'>{old}</calibration>"), &["", ""]);
    let lens = source(&text, &["0.png", "1.png"]).unwrap().views[0].lens;
    let c = lens.pinhole;
    assert_eq!((c.fx_px, c.fy_px, c.cx_px, c.cy_px), (603.78877, 602.11334, 575.92329, 495.30887));
    assert_eq!(lens.distortion, Distortion::None);
}

const CALIBRATION: &str =
    "<calibration type='frame'><resolution width='8' height='6'/><f>8</f></calibration>";

/// A chunk with these cameras, given by attributes, with centres 0, 1, 2 ... along x.
fn small(components: &str, calibration: &str, cameras: &[&str]) -> String {
    let cameras: String = cameras
        .iter()
        .enumerate()
        .map(|(i, attributes)| {
            format!(
                "<camera id='{i}' sensor_id='0' label='{i}' {attributes}><transform>1 0 0 {i} 0 1 0 0 0 0 1 0 0 0 0 1\
                 </transform></camera>"
            )
        })
        .collect();
    format!(
        "<document><chunk label='c'><sensors><sensor id='0' label='s' type='frame'>{calibration}</sensor></sensors>\
         {components}<cameras>{cameras}<camera id='9' sensor_id='0' label='9'/></cameras></chunk></document>"
    )
}

fn warnings(source: &Source) -> Vec<&str> {
    source.report.warnings.iter().map(|w| w.code.as_str()).collect()
}

#[test]
fn cameras_without_pose_or_in_other_components_are_counted() {
    let photos = ["0.png", "1.png", "2.png", "3.png"];
    let component = |id: u32, inside: &str| format!("<component id='{id}'>{inside}</component>");
    let two = |a: &str, b: &str| format!("<components>{}{}</components>", component(0, a), component(1, b));
    let cameras =
        ["component_id='0'", "component_id='1'", "component_id='1'", "component_id='1' enabled='false'"];
    let apart = source(&small(&two("", ""), CALIBRATION, &cameras), &photos).unwrap();
    assert_eq!(apart.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["1.png", "2.png"]);
    assert_eq!(warnings(&apart), ["cameras-in-other-components", "cameras-without-pose", "cameras-disabled"]);
    assert_eq!(apart.stated_up, None, "the axes of a chunk are arbitrary");
    // Both placed in the capture: nothing is left out of it, z is up, scale and translation count.
    let placed = "<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>5 0 0</translation><scale>2</scale></transform>";
    let together = source(&small(&two(placed, placed), CALIBRATION, &cameras), &photos).unwrap();
    assert_eq!((together.views.len(), together.stated_up), (3, Some(DVec3::Z)));
    let centre = together.views[1].camera_from_capture.origin_of_a_in_b();
    assert!(centre.distance(DVec3::new(5.0, 2.0, 0.0)) < 1e-12, "{centre}");
    // One placed: the larger part of both.
    let mixed = source(&small(&two(placed, ""), CALIBRATION, &cameras), &photos).unwrap();
    assert_eq!(mixed.views.len(), 2);
}

#[test]
fn cameras_of_a_broken_component_are_left_out() {
    let transform = |scale: &str| {
        format!(
            "<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation><translation>5 0 0</translation><scale>{scale}</scale>\
             </transform>"
        )
    };
    let xml = |scale: &str, num_broken: usize| {
        let component =
            |id: u32, scale: &str| format!("<component id='{id}'>{}</component>", transform(scale));
        let components = format!("<components>{}{}</components>", component(0, "2"), component(1, scale));
        let cameras: Vec<&str> =
            (0..11).map(|i| if i < num_broken { "component_id='1'" } else { "component_id='0'" }).collect();
        small(&components, CALIBRATION, &cameras).replace("<camera id='9' sensor_id='0' label='9'/>", "")
    };
    let names: Vec<String> = (0..11).map(|i| format!("{i}.png")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    assert_eq!(source(&xml("3", 1), &names).unwrap().views.len(), 11, "negative control");
    for scale in ["x", "0", "nan"] {
        let one = source(&xml(scale, 1), &names).unwrap();
        assert_eq!((one.views.len(), one.names_unused(Why::Broken)), (10, vec!["0"]), "{scale}");
        assert_eq!(warnings(&one), ["views-left-out"]);
        let text = source(&xml(scale, 3), &names).unwrap_err().to_string();
        assert!(text.contains("3 of 11 views") && text.contains("camera \"0\""), "{text}");
    }
}

#[test]
fn other_lenses_and_broken_cameras_are_named() {
    let error = |xml: &str| source(xml, &["0.png", "1.png"]).unwrap_err();
    let fisheye = small("", &CALIBRATION.replace("frame", "fisheye"), &["", ""]);
    let text = error(&fisheye).to_string();
    assert!(text.contains("\"fisheye\"") && text.contains("Undistort Photos"), "{text}");
    assert_eq!(error(&fisheye).exit_code(), 4);
    for (calibration, what) in [
        ("<calibration/>", "the width of its resolution"),
        ("", "has no calibration"),
        (
            "<calibration><resolution width='8' height='6'/><f>-8</f></calibration>",
            "focal length along x is -8",
        ),
        (
            "<calibration><resolution width='8' height='6'/><f>nan</f></calibration>",
            "f: \"nan\" is no number",
        ),
    ] {
        let text = error(&small("", calibration, &["", ""])).to_string();
        assert!(text.contains(what) && text.contains("cameras.xml"), "{text}");
    }
    let zero = small("", CALIBRATION, &["", ""]).replace("1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", &"0 ".repeat(16));
    assert!(
        error(&zero).to_string().contains("camera \"0\": its matrix is not a rotation"),
        "{}",
        error(&zero)
    );
    assert!(error("<document><a/></document>").to_string().contains("no chunk"));
}

#[test]
fn the_file_may_be_named_and_has_any_name() {
    let folder: TempDir = tempdir().unwrap();
    for name in ["0.png", "1.png"] {
        image::RgbImage::new(8, 6).save(folder.path().join(name)).unwrap();
    }
    std::fs::write(folder.path().join("a.xml"), "<calibration/>").unwrap();
    let path = folder.path().join("scan.XML");
    std::fs::write(&path, small("", CALIBRATION, &["", ""])).unwrap();
    for named in [folder.path(), &path] {
        let capture = Capture::load(named, &LoadOptions::default()).unwrap();
        assert_eq!((capture.format.name(), capture.views.len()), ("metashape", 2));
    }
}

/// An XML with a camera for each label, and what each of them holds besides its pose.
fn labelled(cameras: &[(&str, &str)], frames: &str) -> String {
    let (before, rest) = SURVEY.split_once("<camera id").unwrap();
    let camera = format!("<camera id{}", rest.split_once("</camera>").unwrap().0);
    let after = rest.split_once("</camera>").unwrap().1;
    let label = camera.split("label=\"").nth(1).unwrap().split('"').next().unwrap().to_owned();
    let all: String = cameras
        .iter()
        .enumerate()
        .map(|(id, (name, inside))| {
            camera.replace(&label, name).replacen("id=\"0\"", &format!("id=\"{id}\""), 1)
                + inside
                + "</camera>"
        })
        .collect();
    format!("{before}{all}{after}").replace("</chunk>", &format!("{frames}</chunk>"))
}

#[test]
fn labels_that_repeat_are_told_apart_by_the_paths_of_their_photos() {
    let folder = tempdir().unwrap();
    let xml = |text: String| {
        let path = folder.path().join("cameras.xml");
        std::fs::write(&path, text).unwrap();
        read(&path, &CaptureFolder::new(folder.path(), None, false).unwrap())
    };
    let mut cameras: Vec<(String, String)> =
        (0..20).map(|i| (format!("IMG_{i:02}"), String::new())).collect();
    for (name, _) in &cameras {
        std::fs::write(folder.path().join(name).with_extension("jpg"), b"").unwrap();
    }
    for day in ["day1", "day2"] {
        std::fs::create_dir_all(folder.path().join(day)).unwrap();
        std::fs::write(folder.path().join(day).join("IMG_99.jpg"), b"").unwrap();
        cameras.push(("IMG_99".to_owned(), format!("<photo path=\"C:/survey/{day}/IMG_99.JPG\"/>")));
    }
    let load = |cameras: &[(String, String)], frames: &str| {
        let cameras: Vec<(&str, &str)> = cameras.iter().map(|(a, b)| (&**a, &**b)).collect();
        xml(labelled(&cameras, frames))
    };
    let names = |source: &Source| source.views[20..].iter().map(|v| v.name.clone()).collect::<Vec<_>>();
    let both = ["day1/IMG_99.jpg", "day2/IMG_99.jpg"];
    assert_eq!(names(&load(&cameras, "").unwrap()), both);
    // As in the files of a project.
    cameras[20].1.clear();
    cameras[21].1.clear();
    let frames = "<frames><frame id='0'><cameras><camera camera_id='20'><photo path='../day1/IMG_99.jpg'/></camera>\
                  <camera camera_id='21'><photo path='../day2/IMG_99.jpg'/></camera></cameras></frame></frames>";
    assert_eq!(names(&load(&cameras, frames).unwrap()), both);
    // Without paths they are left out by name, up to a tenth.
    std::fs::write(folder.path().join("IMG_99.jpg"), b"").unwrap();
    let source = load(&cameras, "").unwrap();
    assert_eq!(source.views.len(), 20);
    let warning = &source.report.warnings.iter().find(|w| w.code == "views-left-out").unwrap();
    assert!(
        warning.count == 2 && warning.message.contains("camera 20 (\"IMG_99\"): 2 cameras have"),
        "{warning:?}"
    );
    let error = load(&cameras[3..], "").err().unwrap().to_string();
    assert!(error.contains("2 of 19 views") && error.contains("IMG_99"), "{error}");
    // Negative control: a camera that is not used takes no name.
    let mut disabled = cameras.clone();
    disabled[21].0 = "IMG_99\" enabled=\"false".to_owned();
    let source = load(&disabled, "").unwrap();
    assert_eq!(names(&source), ["IMG_99.jpg"]);
    assert!(source.report.warnings.iter().all(|w| w.code != "views-left-out"));
}

#[test]
fn metres_are_known_from_the_earth_or_from_what_was_measured() {
    let metric = |xml: &str| source(xml, &["000001-01_00001.JPG", "0.png", "1.png", "2.png"]).unwrap().metric;
    assert_eq!(metric(SURVEY), Some("Metashape"), "geocentric");
    let placed =
        "<components><component id='0'><transform><scale>2</scale></transform></component></components>";
    let system = |unit: &str| {
        format!(
            "<reference>LOCAL_CS[\"Local Coordinates\",LOCAL_DATUM[\"Local Datum\",0],UNIT[{unit},AUTHORITY[\"EPSG\",\"9001\"]]]</reference>"
        )
    };
    let local = |unit: &str, placed: &str, inside: &str| {
        let xml = small(placed, CALIBRATION, &["component_id='0'"; 3]);
        metric(&xml.replace("</chunk>", &format!("{inside}{}</chunk>", system(unit))))
    };
    let metre = "\"metre\",1";
    let marker = |i: usize, enabled: bool| {
        format!(
            "<marker id='{i}' label='{i}'><reference x='{i}' y='0' z='1.5' enabled='{enabled}'/></marker>"
        )
    };
    let markers = |enabled: [bool; 3]| {
        let all: String = enabled.iter().enumerate().map(|(i, &enabled)| marker(i, enabled)).collect();
        format!("<markers>{all}</markers>")
    };
    let bar = "<scalebars><scalebar id='0' label='a_b'><reference distance='0.5' enabled='true'/></scalebar></scalebars>";
    assert_eq!(local(metre, placed, &markers([true; 3])), Some("Metashape"));
    assert_eq!(local(metre, placed, bar), Some("Metashape"));
    // Negative controls: nothing or too little measured, other units, no similarity, and where that leads nowhere.
    assert_eq!(local(metre, placed, ""), None);
    assert_eq!(local(metre, placed, &markers([true, true, false])), None);
    assert_eq!(local(metre, placed, &bar.replace("true", "false")), None);
    assert_eq!(local("\"millimetre\",0.001", placed, bar), None);
    assert_eq!(local(metre, "", bar), None);
    assert_eq!(metric(&small(placed, CALIBRATION, &["component_id='0'"; 3])), None);
}

#[test]
fn of_several_exports_the_one_with_the_most_cameras_is_read() {
    let folder = tempdir().unwrap();
    let camera = SURVEY.split_once("<camera id=\"0\"").unwrap().1.split_once("</camera>").unwrap().0;
    let again = format!("<camera id=\"1\"{camera}</camera></group>").replace("_00001.JPG", "_00002.JPG");
    let unposed = format!("{}</group>", "<camera id=\"9\" label=\"x\"/>".repeat(5));
    for (name, text) in [
        ("a.xml", SURVEY.to_owned()),
        ("b.xml", SURVEY.replace("</group>", &again)),
        ("c.xml", SURVEY.replace("</group>", &unposed)),
        ("d.xml", "<document><other/>".to_owned()),
    ] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let mut report = Report::default();
    let found = find(folder.path(), &mut report).unwrap();
    let source = (found.read)(&CaptureFolder::new(folder.path(), None, false).unwrap()).unwrap();
    assert!(source.path.ends_with("b.xml"), "{:?}", source.path);
    let warned = &report.warnings[0];
    assert_eq!((&*warned.code, warned.count), ("several-pose-files", 2));
    assert!(warned.message.contains("b.xml (2 cameras)"), "{}", warned.message);
    assert!(warned.message.contains("a.xml (1)") && warned.message.contains("c.xml (1)"));
    let mut report = Report::default();
    assert!(find(&folder.path().join("a.xml"), &mut report).is_some() && report.warnings.is_empty());
}

#[test]
fn exports_in_utf16_are_read() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("cameras.xml");
    let text = SURVEY.replace("UTF-8", "utf-16");
    let units = [0xfeff].into_iter().chain(text.encode_utf16());
    std::fs::write(&path, units.flat_map(u16::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    let found = find(folder.path(), &mut Report::default()).unwrap();
    let source = (found.read)(&CaptureFolder::new(folder.path(), None, false).unwrap()).unwrap();
    assert_eq!(source.num_posed(), 1);
    std::fs::write(&path, text.replace("<chunk", "<piece")).unwrap();
    assert!(find(folder.path(), &mut Report::default()).is_none(), "negative control");
}
