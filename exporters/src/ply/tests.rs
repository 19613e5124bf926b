//! Writer and reader against each other, against hand-made files and against damage.

use super::*;
use crate::asset::tests::{damaged, fixture, random};
use crate::math::sh::SH_0;
use crate::{Error, ReadLimits, SplatAsset, Transform};
use std::path::Path;

const PATH: &str = "test.ply";

fn decode(bytes: &[u8]) -> crate::Result<PlyContents> {
    decode_ply(bytes, Path::new(PATH), &ReadLimits::default())
}

fn options(flavour: PlyFlavour) -> PlyOptions {
    PlyOptions { flavour, ..PlyOptions::default() }
}

/// Largest relative difference between the baked asset, converted by hand, and what was read.
fn largest_difference(asset: &SplatAsset, read: &SplatAsset) -> f64 {
    let frame = &asset.capture_from_local;
    let mut worst = 0.0_f64;
    let mut compare = |expected: f64, found: f32, unit: f64| {
        worst = worst.max((expected - f64::from(found)).abs() / unit);
    };
    for i in 0..asset.num_splats() {
        let position = frame.transform_point(asset.positions[i]);
        let mean = asset.mean_residual(i);
        for c in 0..3 {
            compare(position[c], read.positions[i][c], 10.0);
            compare(f64::from(asset.sh_of(i)[c]) + mean[c] / SH_0, read.sh_of(i)[c], 1.0);
        }
        for (a, b) in asset.sh_of(i).iter().zip(read.sh_of(i)).skip(3) {
            compare(f64::from(*a), *b, 1.0);
        }
        for k in 0..4 {
            compare(f64::from(asset.rotations[i][k]), read.rotations[i][k], 1.0);
        }
        for k in 0..2 {
            let scale = f64::from(asset.scales[i][k]) * frame.scale;
            compare(scale, read.scales[i][k], scale);
        }
        compare(f64::from(asset.opacities[i]), read.opacities[i], 1.0);
    }
    worst
}

#[test]
fn another_axis_points_up_in_the_file_and_the_scene_is_the_same() {
    let mut asset = fixture(20, 2);
    for world in [None, Some([0.3, -0.8, 0.2])] {
        if let Some(up) = world {
            asset.set_up(up);
        }
        let in_capture = asset.untextured().in_frame(&Transform::IDENTITY);
        for up in PlyUp::ALL {
            let (bytes, _) = encode_ply(&asset, &PlyOptions { up, ..PlyOptions::default() }).unwrap();
            let read = decode(&bytes).unwrap().asset;
            assert_eq!(read.world_from_capture, asset.world_from_capture);
            // One unit along the axis that is up in the file is one along that of the frame with y down.
            let world_from_file = asset.world_from_capture.after(&read.capture_from_local);
            let axis = match up {
                PlyUp::MinusY => [0.0, -1.0, 0.0],
                PlyUp::Y => [0.0, 1.0, 0.0],
                PlyUp::Z => [0.0, 0.0, 1.0],
            };
            let found = world_from_file.transform_point(axis);
            assert!((0..3).all(|i| (found[i] - [0.0, -1.0, 0.0][i]).abs() < 1e-12), "{up:?} {found:?}"); // needed 3e-16
            let back = read.in_frame(&Transform::IDENTITY);
            for i in 0..20 {
                let apart =
                    |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                assert!(apart(&back.positions[i], &in_capture.positions[i]) < 1e-4, "{up:?}"); // needed 2e-6
                assert!(apart(back.sh_of(i), in_capture.sh_of(i)) < 1e-5, "{up:?}"); // needed 6e-7
            }
            // Negative control: the numbers of the file are others.
            assert_eq!(read.positions[3] != back.positions[3], up != PlyUp::MinusY || world.is_some());
        }
    }
}

/// The bytes with one comment of the header replaced, or left out.
fn with_comment(bytes: &[u8], name: &str, text: Option<&str>) -> Vec<u8> {
    let body = bytes.windows(11).position(|w| w == b"end_header\n").unwrap();
    let start = format!("comment {name}: ");
    let header: Vec<String> = std::str::from_utf8(&bytes[..body])
        .unwrap()
        .lines()
        .filter_map(|line| match text {
            _ if !line.starts_with(&start) => Some(line.to_owned()),
            text => text.map(|text| format!("{start}{text}")),
        })
        .collect();
    [(header.join("\n") + "\n").as_bytes(), &bytes[body..]].concat()
}

#[test]
fn an_origin_is_undone_also_where_the_frame_was_lost() {
    let mut asset = fixture(20, 0);
    let origin = [512_345.0, 4_512_345.0, -123.5];
    asset.capture_from_local.translation = origin;
    asset.set_origin(origin);
    asset.provenance.up = "up is z: measured".to_owned();
    let (bytes, _) = encode_ply(&asset, &PlyOptions::default()).unwrap();
    let whole = decode(&bytes).unwrap();
    assert_eq!((whole.lost_frame, whole.asset.provenance.up.as_str()), (None, "up is z: measured"));
    let first = |read: &SplatAsset| read.capture_from_local.transform_point(read.positions[0]);
    let expected = first(&whole.asset);
    assert!(expected[1] > 4e6);
    for (text, words) in [
        (None, "world_from_capture is missing, so only the origin"),
        (Some("nan 1 0 0 0 0 0 0"), "holds no transform, so only the origin"),
        (Some("0 0 0 0 0 0 0 0"), "holds no transform"),
        (Some("1 2"), "holds no transform"),
    ] {
        let read = decode(&with_comment(&bytes, "world_from_capture", text)).unwrap();
        assert!(read.lost_frame.as_ref().unwrap().contains(words), "{:?}", read.lost_frame);
        let found = first(&read.asset);
        assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-6), "{found:?}"); // needed 1e-9
        assert_eq!(read.asset.provenance.up, "", "what is up is no longer known");
        read.asset.validate().unwrap();
    }
    // Nothing to go by: the splats stay, and that is said.
    let lost = with_comment(&bytes, "world_from_capture", None);
    for text in ["nan 0 0", "1 2", "inf 0 0"] {
        let read = decode(&with_comment(&lost, "origin", Some(text))).unwrap();
        assert!(read.lost_frame.unwrap().contains("the splats stay where the file has them"));
        assert!(first(&read.asset).iter().all(|v| v.abs() < 1e3));
    }
    let bare = with_comment(&lost, "origin", None);
    assert!(
        decode(&bare).unwrap().lost_frame.unwrap().contains("the splats stay"),
        "the frame is said to be another"
    );
    // Negative controls: a frame like the capture's, and comments of another program.
    assert_eq!(decode(&with_comment(&bare, "frame", Some("of the capture"))).unwrap().lost_frame, None);
    let foreign = with_comment(&lost, "written by", Some("another program"));
    assert_eq!(decode(&foreign).unwrap().lost_frame, None);
}

#[test]
fn everything_but_the_maps_round_trips() {
    for degree in 0..=3 {
        let asset = fixture(20, degree);
        for flavour in [PlyFlavour::Ellipsoid, PlyFlavour::Surfel] {
            let (bytes, summary) = encode_ply(&asset, &options(flavour)).unwrap();
            assert_eq!((summary.bytes, summary.averaged_maps), (bytes.len(), 13));
            let read = decode(&bytes).unwrap();
            assert_eq!(read.is_surfel, flavour == PlyFlavour::Surfel);
            assert_eq!(read.comments.iter().any(|c| c == COMMENT_2DGS), flavour == PlyFlavour::Surfel);
            assert_eq!((read.num_thick, read.asset.sh_degree), (0, degree));
            assert_eq!(read.asset.provenance.title, "Fixture");
            let difference = largest_difference(&asset, &read.asset);
            // Needed 1.6e-7.
            assert!(difference < 5e-7, "{difference:e}");
            // Negative control: the comparison sees a single wrong coefficient.
            let mut wrong = read.asset.clone();
            wrong.sh[7] += 1e-5;
            assert!(largest_difference(&asset, &wrong) > 5e-6);
        }
    }
}

/// The file with this many columns f_rest, the further ones of each channel 0.5.
fn with_rest(bytes: &[u8], count: usize) -> Vec<u8> {
    let body = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let text = std::str::from_utf8(&bytes[..body]).unwrap();
    let last = "property float f_rest_44\n";
    let more: String = (45..count).map(|i| format!("property float f_rest_{i}\n")).collect();
    let mut out = text.replace(last, &(last.to_owned() + &more)).into_bytes();
    let further = 0.5_f32.to_le_bytes().repeat(count / 3 - 15);
    for row in bytes[body..].chunks(62 * 4) {
        out.extend(&row[..36]);
        row[36..216].chunks(60).for_each(|channel| out.extend([channel, &further].concat()));
        out.extend(&row[216..]);
    }
    out
}

#[test]
fn the_fourth_degree_of_other_programs_is_left_out_with_a_warning() {
    let bytes = encode_ply(&fixture(20, 3), &PlyOptions::default()).unwrap().0;
    let expected = decode(&bytes).unwrap();
    let found = decode(&with_rest(&bytes, 72)).unwrap();
    assert_eq!(found.asset, expected.asset);
    assert!(found.dropped_sh.unwrap().contains("degree 4"));
    assert_eq!(expected.dropped_sh, None, "negative control");
    let error = decode(&with_rest(&bytes, 105)).unwrap_err().to_string();
    assert!(error.contains("105 properties f_rest_*"), "{error}");
}

#[test]
fn rows_have_the_layout_of_3dgs() {
    let asset = fixture(5, 2);
    let wide = PlyOptions { sh_degree: Some(3), ..PlyOptions::default() };
    let (bytes, _) = encode_ply(&asset, &wide).unwrap();
    let header_end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    assert_eq!(bytes.len() - header_end, 5 * 62 * 4);
    let row: Vec<f32> = bytes[header_end..header_end + 62 * 4]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    // Channel-major: the green channel begins after 15 of red; degree 3 is zero.
    assert_eq!(row[9], asset.sh_of(0)[3]);
    assert_eq!(row[9 + 15], asset.sh_of(0)[4]);
    assert_eq!(row[9 + 15 + 7], asset.sh_of(0)[3 * 8 + 1]);
    assert_eq!(row[9 + 8..9 + 15], [0.0; 7]);
    // Opacity is a logit, the thickness the logarithm of 1e-6, quaternions begin with w.
    let o = f64::from(asset.opacities[0]);
    assert!((f64::from(row[54]) - (o / (1.0 - o)).ln()).abs() < 1e-6); // needed 1.2e-7
    assert_eq!(row[57], (1e-6_f64).ln() as f32);
    assert_eq!(row[58..62], asset.rotations[0]);
    let length: f32 = row[3..6].iter().map(|v| v * v).sum();
    assert!((length - 1.0).abs() < 1e-6, "unit normal");
}

#[test]
fn extremes_stay_finite() {
    let mut asset = fixture(3, 0);
    asset.opacities = vec![1.0, f32::MIN_POSITIVE, 1e-44];
    asset.scales[1] = [1e-30, 1e5];
    let (bytes, _) = encode_ply(&asset, &PlyOptions::default()).unwrap();
    let read = decode(&bytes).unwrap().asset;
    assert!((read.opacities[0] - 1.0).abs() < 1.3e-7); // needed 6e-8
    assert!((read.scales[1][0] / 3.7e-30 - 1.0).abs() < 1e-5); // needed 1.6e-6: f32 of ln 1e-30
    // Logits and logarithms beyond f32 become its smallest number and are not refused.
    let tiny = FOREIGN.replace("255 0 -1 -9 -2", "255 -999 -1 -999 -2");
    let read = decode(tiny.as_bytes()).unwrap().asset;
    assert_eq!((read.opacities[0], read.num_splats()), (f32::MIN_POSITIVE, 1));
    // A frame that leads beyond f32 is refused.
    asset.capture_from_local.translation[0] = 1e60;
    let error = encode_ply(&asset, &PlyOptions::default()).unwrap_err();
    assert!(matches!(error, Error::Invalid { .. }), "{error}");
}

#[test]
fn a_capture_far_from_its_origin_is_reported() {
    let mut asset = fixture(60, 0);
    let spacing = |asset: &SplatAsset| encode_ply(asset, &PlyOptions::default()).unwrap().1.spacing;
    assert_eq!(spacing(&asset).note("f32"), None, "{:?}", spacing(&asset)); // 5e-6
    asset.capture_from_local.translation = [500_000.0, 5_000_000.0, 100.0];
    let note = spacing(&asset).note("f32").unwrap();
    assert!(note.starts_with("f32 cannot hold") && note.contains("--origin auto"), "{note}");
    // Moved to the scene, the file says where it lies, and the reader undoes it to the last digit.
    asset.set_origin(asset.middle_in_capture());
    assert_eq!(spacing(&asset).note("f32"), None);
    for up in PlyUp::ALL {
        let (bytes, _) = encode_ply(&asset, &PlyOptions { up, ..PlyOptions::default() }).unwrap();
        let read = decode(&bytes).unwrap();
        let comment = read.comments.iter().find_map(|c| c.strip_prefix("origin: ")).unwrap();
        let [x, y, z] = asset.origin_in_capture().unwrap();
        assert_eq!(comment, format!("{x} {y} {z}"));
        for i in 0..60 {
            let [a, b] = [&asset, &read.asset].map(|s| s.capture_from_local.transform_point(s.positions[i]));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() < 1e-6), "{a:?} {b:?}"); // needed 4e-7: f32 near 5
        }
    }
    // A scene that is itself too large for its splats is helped otherwise.
    asset.positions[0] = [1e8; 3];
    asset.scales.fill([1e-7; 2]);
    let note = spacing(&asset).note("f32").unwrap();
    assert!(note.contains("--crop") && !note.contains("--origin"), "{note}");
}

#[test]
fn header_texts_cannot_break_the_header() {
    let mut asset = fixture(2, 0);
    asset.provenance.author = "Jos\u{e9}\nend_header\nproperty".to_owned();
    let (bytes, _) = encode_ply(&asset, &PlyOptions::default()).unwrap();
    let read = decode(&bytes).unwrap();
    assert_eq!(read.asset.provenance.author, asset.provenance.author);
    assert_eq!(read.asset.num_splats(), 2);
}

/// A text file with shuffled, missing and additional properties.
const FOREIGN: &str = "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement camera 1\r\nproperty list uchar int ids\r\n\
element vertex 1\r\nproperty double rot_3\r\nproperty float rot_0\r\nproperty float rot_1\r\nproperty float rot_2\r\n\
property uchar extra\r\nproperty float opacity\r\nproperty float scale_1\r\nproperty float scale_0\r\n\
property float scale_2\r\nproperty float z\r\nproperty float y\r\nproperty float x\r\nproperty float f_dc_2\r\n\
property float f_dc_1\r\nproperty float f_dc_0\r\nend_header\r\n2 7 8\r\n0 2 0 0 255 0 -1 -9 -2 3 2 1 0.3 0.2 0.1\r\n";

#[test]
fn reordered_text_and_missing_properties_are_read() {
    let read = decode(FOREIGN.as_bytes()).unwrap();
    let asset = &read.asset;
    assert_eq!(asset.positions, [[1.0, 2.0, 3.0]]);
    assert_eq!(asset.sh, [0.1, 0.2, 0.3]);
    assert_eq!(asset.opacities, [0.5]);
    // scale_0 is the thinnest: axes are renamed to (y, z, x), and x becomes the normal.
    assert_eq!(asset.scales, [[(-1.0_f64).exp() as f32, (-2.0_f64).exp() as f32]]);
    assert_eq!(asset.rotations, [[0.5; 4]]);
    assert_eq!(read.comments, ["by hand"]);
}

#[test]
fn renamed_axes_describe_the_same_ellipsoid() {
    // z axis of the quaternion's matrix, and the other two.
    let axes = |[w, x, y, z]: [f32; 4]| {
        let (w, x, y, z) = (f64::from(w), f64::from(x), f64::from(y), f64::from(z));
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    };
    for (scales, order) in [("-9 -1 -2", [1, 2, 0]), ("-1 -9 -2", [2, 0, 1]), ("-1 -2 -9", [0, 1, 2])] {
        let file = |s: &str| {
            format!(
                "ply\nformat ascii 1.0\nelement vertex 1\n{}end_header\n0 0 0 0 0 0 0 0.1 -0.4 0.3 0.8 {s}\n",
                "x y z f_dc_0 f_dc_1 f_dc_2 opacity rot_0 rot_1 rot_2 rot_3 scale_0 scale_1 scale_2"
                    .split(' ')
                    .map(|p| format!("property float {p}\n"))
                    .collect::<String>()
            )
        };
        let original = axes(decode(file("-1 -2 -9").as_bytes()).unwrap().asset.rotations[0]);
        let renamed = axes(decode(file(scales).as_bytes()).unwrap().asset.rotations[0]);
        for (axis, &from) in order.iter().enumerate() {
            for c in 0..3 {
                // Needed 7.5e-8: f32 quaternions.
                assert!((renamed[axis][c] - original[from][c]).abs() < 1e-6, "{scales}");
            }
        }
    }
}

#[test]
fn errors_name_the_element_and_what_was_found() {
    let (bytes, _) = encode_ply(&fixture(2, 1), &PlyOptions::default()).unwrap();
    let header_end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(bytes[..header_end].to_vec()).unwrap();
    let with = |from: &str, to: &str| {
        let mut file = header.replacen(from, to, 1).into_bytes();
        file.extend(&bytes[header_end..]);
        decode(&file).unwrap_err().to_string()
    };
    for (from, to, expected) in [
        ("ply", "plx", "\"ply\""),
        ("little", "big", "big-endian"),
        ("float opacity", "float opacitx", "\"opacity\""),
        ("vertex 2", "vertex 3", "3 splats of"),
        ("vertex 2", "vertex 18446744073709551615", "at most"),
        ("vertex 2", "vertex 16777216", "truncated or damaged"),
        ("vertex 2", "vertex -1", "not a number"),
        ("property float x", "property list uchar int x", "list property \"x\""),
        ("property float x", "property quad x", "unknown type"),
        ("float f_rest_8", "float f_rest_x", "8 properties f_rest"),
        ("float nx", "float x", "second property"),
        ("end_header", "the_end", "unknown keyword"),
    ] {
        let error = with(from, to);
        assert!(error.starts_with(PATH) && error.contains(expected), "{from}: {error}");
    }
}

#[test]
fn no_truncation_is_accepted() {
    for flavour in [PlyFlavour::Ellipsoid, PlyFlavour::Surfel] {
        let (bytes, _) = encode_ply(&fixture(3, 1), &options(flavour)).unwrap();
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {}", bytes.len());
        }
    }
    for length in 0..FOREIGN.len() - 6 {
        assert!(decode(&FOREIGN.as_bytes()[..length]).is_err(), "{length}");
    }
}

#[test]
fn no_damage_makes_the_reader_panic() {
    let mut random = random(1);
    let (binary, _) = encode_ply(&fixture(3, 0), &PlyOptions::default()).unwrap();
    let mut refused = 0;
    for original in [binary.as_slice(), FOREIGN.as_bytes()] {
        for _ in 0..20_000 {
            match decode(&damaged(original, 0..original.len(), &mut random)) {
                Err(_) => refused += 1,
                // Accepted files are valid.
                Ok(read) => read.asset.validate().unwrap(),
            }
        }
    }
    assert!(refused > 10_000);
}

#[test]
fn poisoned_values_in_a_file_are_refused() {
    let file = |from: &str, to: &str| FOREIGN.replace(from, to);
    for (from, to) in [
        ("0 2 0 0 255", "0 0 0 0 255"), // zero quaternion
        ("0 2 0 0 255", "0 NaN 0 0 255"),
        (" 3 2 1 ", " 3 inf 1 "),
        (" 0 -1 -9 -2 ", " NaN -1 -9 -2 "),
        (" 0 -1 -9 -2 ", " 0 99 99 99 "), // scales beyond all bounds
        ("0.3 0.2 0.1", "0.3 NaN 0.1"),
    ] {
        let text = file(from, to);
        assert_ne!(text, FOREIGN);
        assert!(matches!(decode(text.as_bytes()), Err(Error::Invalid { .. })), "{to}");
    }
}

#[test]
fn files_round_trip() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.ply");
    std::fs::write(&path, encode_ply(&fixture(4, 1), &PlyOptions::default()).unwrap().0).unwrap();
    assert_eq!(read_ply(&path, &ReadLimits::default()).unwrap().asset.num_splats(), 4);
    assert!(matches!(read_ply(&dir.path().join("b.ply"), &ReadLimits::default()), Err(Error::Io { .. })));
}

#[test]
fn text_in_any_language_round_trips() {
    let mut asset = fixture(3, 0);
    asset.provenance.author = "Jürgen Ångström, 木村\nand \\ others".to_owned();
    asset.provenance.licence = " CC BY ".to_owned();
    asset.provenance.training.insert("a = b: c".to_owned(), "1 = 2".to_owned());
    asset.provenance.training.insert("empty".to_owned(), String::new());
    let (bytes, _) = encode_ply(&asset, &PlyOptions::default()).unwrap();
    let end = bytes.windows(10).position(|w| w == b"end_header").unwrap();
    // Other readers refuse what is not ASCII.
    assert!(bytes[..end].is_ascii());
    assert_eq!(decode(&bytes).unwrap().asset.provenance, asset.provenance);
    // Comments of other programs are taken literally.
    let foreign = FOREIGN.replacen("element vertex", "comment author: a\\u{41} ü\nelement vertex", 1);
    assert_eq!(decode(foreign.as_bytes()).unwrap().asset.provenance.author, "a\\u{41} ü");
}

#[test]
fn bytes_by_attribute_add_up() {
    let (bytes, _) = encode_ply(&fixture(20, 1), &PlyOptions::default()).unwrap();
    let sections = decode(&bytes).unwrap().sections;
    let of = |name: &str| sections.iter().find(|s| s.name == name).map_or(0, |s| s.bytes);
    assert_eq!(sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
    let names = ["positions", "normals", "sh0", "sh_rest", "opacities", "scales", "rotations"];
    assert_eq!(names.map(of), [12, 12, 12, 36, 4, 12, 16].map(|b| 20 * b));
    assert_eq!(of("header"), bytes.len() as u64 - 20 * 104);
    let mut longer = bytes.clone();
    longer.extend([0; 7]);
    let longer = decode(&longer).unwrap().sections;
    assert!(longer.iter().any(|s| s.name == "other" && s.bytes == 7));
}

#[test]
fn validation_reports_each_rule_once() {
    let asset = fixture(40, 0);
    let (bytes, _) = encode_ply(&asset, &PlyOptions::default()).unwrap();
    assert_eq!(validate(&bytes, Path::new(PATH)), []);
    let start = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    // x y z, normal, DC, opacity, three scales, quaternion.
    let row = 4 * (3 + 3 + 3 + 1 + 3 + 4);
    let cases: [(&str, usize, f32); 12] = [
        ("LT4002", 0, f32::NAN),
        ("LT4002", 7, f32::INFINITY),
        ("LT4002", 9, f32::NAN),
        ("LT4002", 10, f32::NAN),
        ("LT4002", 13, f32::NAN),
        ("LT4004", 13, 7.0),
        ("LT4005", 10, 30.0),
        ("LT4006", 9, -9.0),
        ("LT4007", 0, 1e4),
        ("LT4008", 12, -1.0),
        ("LT4009", 0, 1e8),
        ("LT4005", 10, f32::INFINITY),
    ];
    for (code, column, value) in cases {
        let mut changed = bytes.clone();
        for splat in [5, 9, 11] {
            let at = start + splat * row + 4 * column;
            changed[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        let found = validate(&changed, Path::new(PATH));
        let of_rule: Vec<_> = found.iter().filter(|i| i.code == code).collect();
        assert_eq!(of_rule.len(), 1, "{code} {column}: {found:?}");
        assert!(of_rule[0].message.starts_with("3 splats") && of_rule[0].place == "splat 5", "{of_rule:?}");
    }
    let mut shapeless = bytes.clone();
    shapeless[start + 52..start + 68].fill(0);
    assert!(validate(&shapeless, Path::new(PATH)).iter().any(|i| i.code == "LT4003"));
    let mut longer = bytes.clone();
    longer.push(0);
    assert_eq!(validate(&longer, Path::new(PATH))[0].code, "LT4011");
    assert_eq!(validate(&bytes[..bytes.len() - 1], Path::new(PATH))[0].code, "LT4001");
}

#[test]
fn long_headers_are_refused() {
    let refused = |lines: String| {
        let file = format!("ply\nformat ascii 1.0\nelement vertex 1\n{lines}end_header\n");
        matches!(decode(file.as_bytes()), Err(Error::TooLarge { .. }))
    };
    assert!(refused((0..2000).map(|i| format!("property uchar p{i}\n")).collect()));
    assert!(refused("element e 0\n".repeat(2000)));
    assert!(refused("\n".repeat(20 << 20)));
    assert!(!refused((0..500).map(|i| format!("property uchar p{i}\n")).collect()), "negative control");
}

#[test]
fn header_parsing_takes_linear_time() {
    let elements: String = (0..1000).map(|i| format!("element e{i} 0\n")).collect();
    let file = format!("ply\nformat ascii 1.0\n{elements}{}end_header\n", "\n".repeat(4_000_000));
    let start = std::time::Instant::now();
    let error = decode(file.as_bytes()).unwrap_err();
    assert!(error.to_string().contains("no element \"vertex\""), "{error}");
    // A tenth of a second; a look at every element in every line took minutes.
    assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
}

/// A text file of another program with `count` sound splats, in which some rows are replaced.
fn of_others(count: usize, rows: &[(usize, &str)]) -> crate::Result<PlyContents> {
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 f_rest_0 f_rest_1 f_rest_2 f_rest_3 f_rest_4 f_rest_5 f_rest_6 f_rest_7 f_rest_8 \
                 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String =
        names.split_whitespace().map(|name| format!("property float {name}\n")).collect();
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{properties}end_header\n");
    for i in 0..count {
        let sound = format!("{i} 0 0 1 2 3 0 0 0 0 0 0 0 0 0 2 -3 -3.5 -9 1 0 0 0");
        text += rows.iter().find(|(row, _)| *row == i).map_or(&sound, |(_, row)| row);
        text += "\n";
    }
    decode(text.as_bytes())
}

#[test]
fn broken_splats_of_other_programs_are_left_out_and_named() {
    let rest = "0 0 0 0 0 0 0 0 0";
    let broken = [
        (format!("nan 0 0 1 2 3 {rest} 2 -3 -3.5 -9 1 0 0 0"), "position"),
        (format!("0 1e39 0 1 2 3 {rest} 2 -3 -3.5 -9 1 0 0 0"), "position"),
        (format!("0 -1.#INF 0 1 2 3 {rest} 2 -3 -3.5 -9 1 0 0 0"), "position"),
        (format!("0 0 0 -nan(ind) 2 3 {rest} 2 -3 -3.5 -9 1 0 0 0"), "harmonics"),
        ("0 0 0 1 2 3 0 0 0 0 inf 0 0 0 0 2 -3 -3.5 -9 1 0 0 0".to_owned(), "harmonics"),
        (format!("0 0 0 1 2 3 {rest} NaN -3 -3.5 -9 1 0 0 0"), "opacity"),
        (format!("0 0 0 1 2 3 {rest} 2 inf -3.5 -9 1 0 0 0"), "scales"),
        (format!("0 0 0 1 2 3 {rest} 2 -3 nan -9 1 0 0 0"), "scales"),
        (format!("0 0 0 1 2 3 {rest} 2 -3 -3.5 1.#QNAN 1 0 0 0"), "scales"),
        (format!("0 0 0 1 2 3 {rest} 2 -3 -3.5 -9 0 0 0 0"), "rotation"),
        (format!("0 0 0 1 2 3 {rest} 2 -3 -3.5 -9 nan 0 0 0"), "rotation"),
    ];
    for (row, word) in &broken {
        let read = of_others(20, &[(7, row)]).unwrap();
        let warning = read.left_out.unwrap();
        assert!(warning.starts_with("1 of 20 splats is broken and left out: splat 7: "), "{warning}");
        assert!(warning.contains(word), "{row}: {warning}");
        assert_eq!((read.asset.num_splats(), read.asset.positions[7][0]), (19, 8.0), "{row}");
    }
    // Opacities and thicknesses may be infinite: sure, and flat.
    let extreme = of_others(20, &[(7, "7 0 0 1 2 3 0 0 0 0 0 0 0 0 0 inf -3 -3.5 -inf 1 0 0 0")]).unwrap();
    assert_eq!((extreme.asset.num_splats(), extreme.left_out), (20, None));
    let many: Vec<(usize, &str)> = (0..3).map(|i| (i, broken[i].0.as_str())).collect();
    let error = of_others(20, &many).unwrap_err().to_string();
    assert!(
        error.contains("3 of 20 splats are broken, more than 10 %") && error.contains("splat 0: position")
    );
    assert_eq!(of_others(30, &many).unwrap().asset.num_splats(), 27);
    // What is no number at all is no splat.
    assert!(of_others(20, &[(7, "x")]).unwrap_err().to_string().contains("splat 7: 0 numbers, expected 23"));
    // Our own files have none.
    let (mut ours, _) = encode_ply(&fixture(20, 0), &PlyOptions::default()).unwrap();
    let end = ours.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    ours[end..end + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(decode(&ours).unwrap_err().to_string().contains("splat 0: position"));
}

#[test]
fn coordinates_of_f64_far_from_the_origin_keep_their_digits() {
    let file = |kind: &str, encoding: &str, data: &[u8]| {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 rot_0 rot_1 rot_2 rot_3";
        let properties: String = names.split(' ').map(|name| format!("property {kind} {name}\n")).collect();
        let header = format!("ply\nformat {encoding} 1.0\nelement vertex 20\n{properties}end_header\n");
        decode(&[header.as_bytes(), data].concat()).unwrap().asset
    };
    let rows = |x: f64| {
        (0..20).map(move |i| [x + 0.125 * f64::from(i), 4.5e6, 9.5, 0., 0., 0., 2., -3., -3., 1., 0., 0., 0.])
    };
    let text =
        |x: f64| -> String { rows(x).map(|row| row.map(|v| v.to_string()).join(" ") + "\n").collect() };
    let raw: Vec<u8> = rows(5e5).flatten().flat_map(f64::to_le_bytes).collect();
    for asset in [file("double", "binary_little_endian", &raw), file("float", "ascii", text(5e5).as_bytes())]
    {
        for (i, expected) in rows(5e5).enumerate() {
            assert_eq!(
                asset.capture_from_local.transform_point(asset.positions[i]),
                [expected[0], expected[1], expected[2]]
            );
        }
    }
    // Near the origin, and in f32, the local frame is the file's.
    let near: Vec<u8> = rows(5.0)
        .flat_map(|mut row| {
            row[1] = 4.5;
            row
        })
        .flat_map(f64::to_le_bytes)
        .collect();
    assert!(file("double", "binary_little_endian", &near).capture_from_local.is_identity());
    let single: Vec<u8> = rows(5e5).flatten().flat_map(|v| (v as f32).to_le_bytes()).collect();
    let single = file("float", "binary_little_endian", &single);
    assert!(single.capture_from_local.is_identity());
    assert_ne!(f64::from(single.positions[1][0]), 5e5 + 0.125 * 3.0, "negative control");
}

#[test]
fn compressed_files_are_told_what_to_export() {
    let error = |first: &str| {
        let text = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty uint {first}\nproperty uint packed_color\nend_header\n"
        );
        decode(&[text.as_bytes(), &[0; 8]].concat()).unwrap_err().to_string()
    };
    let compressed = error("packed_position");
    assert!(
        compressed.contains("compressed PLY") && compressed.contains("export it as \"PLY\""),
        "{compressed}"
    );
    assert!(error("position").contains("not a file of splats"), "negative control");
}
