use super::*;
use crate::capture::{Capture, LoadOptions};
use tempfile::{TempDir, tempdir};

/// A sidecar file of RealityCapture, published in issue 2383 of nerfstudio.
const PORTRAIT: &str = r#"<x:xmpmeta xmlns:x="adobe:ns:meta/">
  <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
    <rdf:Description xcr:Version="3" xcr:PosePrior="locked" xcr:Coordinates="absolute"
       xcr:DistortionModel="brown3t2" xcr:FocalLength35mm="65.478964140309"
       xcr:Skew="0" xcr:AspectRatio="1" xcr:PrincipalPointU="-0.012871369016343"
       xcr:PrincipalPointV="0.0017358637506797" xcr:CalibrationPrior="exact"
       xcr:CalibrationGroup="-1" xcr:DistortionGroup="-1" xcr:latitude="179.998188655585693N"
       xcr:longitude="37.983578116223768E" xcr:version="2.2.0.0" xcr:altitude="643099440/10000"
       xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">
      <xcr:Rotation>-0.628072249977553 0.778153220693978 -0.00167747778664398 0.0382608693246996 0.0287283186031107 -0.998854738982983 -0.777213841028742 -0.627417125072173 -0.0478162783946945</xcr:Rotation>
      <xcr:Position>3.92101192706972 3.06162084997137 1.34968371224218</xcr:Position>
      <xcr:DistortionCoeficients>-0.062191034720569 2.3214570830388 -26.2121457576208 0 0.000332769342338838 0.000451019835287317</xcr:DistortionCoeficients>
    </rdf:Description>
  </rdf:RDF>
</x:xmpmeta>
"#;

/// Another, published in the documentation of KU-Leuven-Geomatics/geomapi.
const BUILDING: &str = r#"<x:xmpmeta xmlns:x="adobe:ns:meta/">
  <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
    <rdf:Description xcr:Version="3" xcr:PosePrior="locked" xcr:Coordinates="absolute"
       xcr:DistortionModel="brown3" xcr:FocalLength35mm="24.3765359225552"
       xcr:Skew="0" xcr:AspectRatio="1" xcr:PrincipalPointU="-0.000464752782510192"
       xcr:PrincipalPointV="-0.000823593392050301" xcr:CalibrationPrior="exact"
       xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">
      <xcr:Rotation>0.412555151152903 0.910841439690343 0.0128887159933671 0.0412058430083455 -0.00452553581407911 -0.999140429583083 -0.910000178988533 0.412731621357468 -0.0393990224812024</xcr:Rotation>
      <xcr:Position>66.8850552499877 45.2551194778559 5.45377092514118</xcr:Position>
      <xcr:DistortionCoeficients>-0.124217384759894 0.107339706650415 -0.0104748224573926 0 0 0</xcr:DistortionCoeficients>
    </rdf:Description>
  </rdf:RDF>
</x:xmpmeta>
"#;

/// A folder with photos of 36 x 18 pixels and their sidecars, in this folder of it.
fn written(inside: &str, sidecars: &[(&str, &str)]) -> TempDir {
    let folder = tempdir().unwrap();
    let photos = folder.path().join(inside);
    std::fs::create_dir_all(&photos).unwrap();
    for (stem, text) in sidecars {
        image::RgbImage::new(36, 18).save(photos.join(format!("{stem}.png"))).unwrap();
        std::fs::write(photos.join(format!("{stem}.xmp")), text).unwrap();
    }
    folder
}

fn source(folder: &TempDir) -> Result<Source> {
    read(&CaptureFolder::new(folder.path(), None, false).unwrap())
}

#[test]
fn published_sidecars_are_of_level_cameras_that_look_at_their_scene() {
    let folder = written("", &[("a", PORTRAIT), ("b", BUILDING)]);
    let source = source(&folder).unwrap();
    for view in &source.views {
        let axes = view.camera_from_capture.rotation.transpose();
        assert!((axes * DVec3::X).z.abs() < 0.02 && (axes * DVec3::Y).z < -0.99, "{}", view.name);
        // Negative control: the transposed matrix is of a camera that lies on its side.
        let other = view.camera_from_capture.rotation;
        assert!((other * DVec3::X).z.abs() > 0.7, "{}", view.name);
    }
    let portrait = &source.views[0];
    let centre = portrait.camera_from_capture.origin_of_a_in_b();
    assert!(centre.distance(DVec3::new(3.92101192706972, 3.06162084997137, 1.34968371224218)) < 1e-12);
    let forward = portrait.camera_from_capture.rotation.transpose() * DVec3::Z;
    assert!(forward.truncate().normalize().dot(-centre.truncate().normalize()) > 0.99, "at the scene");
    assert_eq!(source.stated_up, Some(DVec3::Z));
}

#[test]
fn principal_points_are_shares_of_the_longer_side() {
    let folder = written("images", &[("a", PORTRAIT), ("b", BUILDING)]);
    let lens = source(&folder).unwrap().views[0].lens;
    let c = lens.pinhole;
    assert!((c.fx_px - 65.478964140309).abs() < 1e-12 && c.fx_px == c.fy_px);
    assert!((c.cx_px - (18.0 - 0.012871369016343 * 36.0)).abs() < 1e-12);
    assert!((c.cy_px - (9.0 + 0.0017358637506797 * 36.0)).abs() < 1e-12);
    let k = [-0.062191034720569, 2.3214570830388, -26.2121457576208, 0.0];
    let p = [0.000332769342338838, 0.000451019835287317];
    assert_eq!(lens.distortion, Distortion::Brown { k, p, shear: 0.0 });
}

#[test]
fn sidecars_without_pose_are_counted_and_those_of_other_programs_ignored() {
    let unposed = PORTRAIT.replace("xcr:Position", "xcr:Pos");
    // Newer versions write properties as attributes.
    let attribute = PORTRAIT
        .replace("xcr:Version=\"3\"", "xcr:DistortionCoeficients='0 0 0 0 0 0'")
        .replace("brown3t2", "perspective")
        .replace("DistortionCoeficients>", "Other>");
    let other = "<x:xmpmeta xmlns:x='adobe:ns:meta/'/>";
    let sidecars = [("a", PORTRAIT), ("b/c", other), ("b/d", &attribute), ("e", &unposed), ("f", PORTRAIT)];
    let folder = tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("images/b")).unwrap();
    for (stem, text) in sidecars {
        let path = folder.path().join("images").join(stem);
        image::RgbImage::new(36, 18).save(path.with_extension("png")).unwrap();
        std::fs::write(path.with_extension("xmp"), text).unwrap();
    }
    std::fs::remove_file(folder.path().join("images/f.png")).unwrap();
    let source = source(&folder).unwrap();
    assert_eq!(source.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["a.png", "b/d.png"]);
    assert_eq!(source.views[1].lens.distortion, Distortion::None);
    assert_eq!(source.names_unused(Why::NoPhoto), ["f"]);
    assert_eq!(source.report.warnings[0].code, "cameras-without-pose");
    let capture = Capture::load(folder.path(), &LoadOptions::default()).unwrap();
    assert_eq!((capture.format.name(), capture.views.len()), ("reality-xmp", 2));
}

#[test]
fn sidecars_of_photo_editors_may_have_long_tags() {
    let xmlns = "xmlns:xcr=\"http://www.capturingreality.com/ns/xcr/1.1#\"";
    let with = |before_bytes: usize, after_bytes: usize| {
        let [before, after] = [before_bytes, after_bytes].map(|bytes| "0, ".repeat(bytes / 3));
        let crs = "xmlns:crs=\"http://ns.adobe.com/camera-raw-settings/1.0/\"";
        let tag = format!("{crs} crs:Curve=\"{before}\" {xmlns} crs:Mask=\"{after}\"");
        let text = PORTRAIT.replace(xmlns, &tag);
        source(&written("", &[("a", &text), ("b", PORTRAIT)]))
    };
    assert_eq!(with(100_000, 50_000).unwrap().views.len(), 2);
    let text = with(0, 2_000_000).unwrap_err().to_string();
    assert!(text.contains("camera \"a\"") && text.contains("a tag has"), "negative control: {text}");
}

#[test]
fn what_is_not_read_is_named() {
    let error = |from: &str, to: &str| {
        let text = PORTRAIT.replace(from, to);
        source(&written("", &[("a", &text), ("b", &text)])).unwrap_err()
    };
    let division = error("brown3t2", "division");
    assert!(division.exit_code() == 4 && division.to_string().contains("\"division\""), "{division}");
    for (from, to, what) in [
        ("3.92101192706972 ", "", "Position: 2 numbers found, expected 3"),
        ("65.478964140309", "0", "focal length along x is 0"),
        ("-0.628072249977553", "0.2", "not a rotation"),
        ("xcr:FocalLength35mm", "xcr:Focal", "no FocalLength35mm"),
        ("</rdf:RDF>", "", "not a valid XML document"),
    ] {
        let text = error(from, to).to_string();
        assert!(text.contains("camera \"a\"") && text.contains(what), "{text}");
    }
}

#[test]
fn a_sidecar_that_was_cut_off_leaves_its_view_out_by_name() {
    let stems = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"];
    let with = |text: &'static str| {
        source(&written("", &stems.map(|stem| (stem, if stem == "c" { text } else { PORTRAIT })))).unwrap()
    };
    // Before the namespace that tells whose it is.
    for text in [&PORTRAIT[..100], ""] {
        let source = with(text);
        assert_eq!((source.views.len(), source.names_unused(Why::Broken)), (11, vec!["c"]));
        let warning = &source.report.warnings[0];
        assert_eq!((&*warning.code, warning.count), ("views-left-out", 1));
        assert!(warning.message.contains("1 of 12 views") && warning.message.contains("camera \"c\""));
    }
    let source = with("<x:xmpmeta xmlns:x='adobe:ns:meta/'/>");
    assert_eq!(source.views.len(), 11);
    assert!(source.report.warnings.is_empty(), "negative control: of another program");
}
