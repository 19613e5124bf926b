//! Writers and readers against each other and against damage.

mod hostile;

use super::binary::{binary_from_layer, layer_from_binary};
use super::layer::Layer;
use super::read::Opened;
use super::text_read::layer_from_text;
use super::text_write::text_from_layer;
use super::*;
use crate::asset::tests::{camera, fixture};
use crate::atlas::TexelDecode;
use crate::{Contents, Error, Quality, ReadLimits, Result, Severity, SplatAsset, Transform};
use std::path::{Path, PathBuf};

const EXTENSIONS: [&str; 3] = ["usda", "usdc", "usdz"];

/// A fixture with everything that an asset may have.
fn full(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut asset = fixture(num_splats, sh_degree);
    asset.capture_from_local =
        Transform { scale: 1.0 / 3.0, rotation: [0.5, -0.5, 0.5, 0.5], translation: [1e6 / 7.0, -0.1, 3.0] };
    asset.background = [0.1, 0.2, 1.0];
    asset.positions[0] = [-0.0, 1e-42, 16_777_216.0];
    asset.texels[0] = -0.0;
    asset.provenance.title = "A \"title\" \\ with\nlines, \u{1}, ü and 木".into();
    asset.provenance.training.insert("steps".into(), "7000".into());
    asset.cameras.push(camera());
    asset
}

fn options(quality: Quality) -> UsdOptions {
    UsdOptions { quality, page_side: 64, ..UsdOptions::default() }
}

fn write(folder: &Path, name: &str, asset: &SplatAsset, quality: Quality) -> PathBuf {
    let path = folder.join(name);
    let files = write_usd(&path, asset, &options(quality)).unwrap();
    assert_eq!(files[0], path);
    assert!(files.iter().all(|f| f.is_file()));
    path
}

fn read(path: &Path) -> Result<Contents> {
    read_usd(path, &ReadLimits::default())
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn lossless_files_round_trip_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for degree in 0..4 {
        let asset = full(100, degree);
        for extension in EXTENSIONS {
            let path = write(folder.path(), &format!("s{degree}.{extension}"), &asset, Quality::Lossless);
            let contents = read(&path).unwrap();
            assert_eq!(contents.asset, asset, "{extension}");
            assert_eq!(bits(&contents.asset.texels), bits(&asset.texels));
            assert_eq!(bits(contents.asset.positions.as_flattened()), bits(asset.positions.as_flattened()));
            assert_eq!(contents.warnings, Vec::<String>::new());
            assert_eq!((contents.quality, contents.hash), (Some(Quality::Lossless), Some(asset.hash())));
            let mut size = std::fs::metadata(&path).unwrap().len();
            if extension != "usdz" {
                let pages =
                    std::fs::read_dir(folder.path().join(format!("s{degree}_{extension}_textures"))).unwrap();
                let pages =
                    pages.map(|f| f.unwrap()).filter(|f| f.file_name().to_string_lossy().starts_with("page"));
                size += pages.map(|f| f.metadata().unwrap().len()).sum::<u64>();
            }
            assert_eq!(contents.sections.iter().map(|s| s.bytes).sum::<u64>(), size, "{extension}");
            assert!(contents.sections.iter().any(|s| s.name == "positions") || extension == "usda");
        }
    }
}

/// Writes samples for `tests/python/check_usd.py` into the folder `LITETEX_USD_SAMPLES`, with the hashes of their arrays.
#[test]
fn samples_for_other_programs() {
    let Some(folder) = std::env::var_os("LITETEX_USD_SAMPLES").map(PathBuf::from) else {
        println!("skipped: LITETEX_USD_SAMPLES names no folder");
        return;
    };
    let mut expected = serde_json::Map::new();
    for (name, asset) in [("small", full(100, 3)), ("large", full(20_000, 1)), ("bare", fixture(0, 0))] {
        for quality in [Quality::Lossless, Quality::Balanced] {
            for extension in EXTENSIONS {
                let stem = format!("{name}_{}", quality.name());
                let options = UsdOptions { page_side: 512, ..options(quality) };
                write_usd(&folder.join(format!("{stem}.{extension}")), &asset, &options).unwrap();
                let entry = serde_json::json!({ "count": asset.num_splats(), "arrays": hashes(&asset) });
                expected.insert(format!("{stem}.{extension}"), entry);
            }
        }
    }
    std::fs::write(folder.join("expected.json"), serde_json::to_vec(&expected).unwrap()).unwrap();
}

/// CRC-32 of arrays as other programs should see them, computed independently of the writer.
fn hashes(asset: &SplatAsset) -> serde_json::Map<String, serde_json::Value> {
    let floats = |values: Vec<f32>| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let positions = asset.positions.iter().flat_map(|&[x, y, z]| [x, -y, -z]).collect();
    let rotations = asset.rotations.iter().flat_map(|&[w, x, y, z]| [w, -z, y, -x]).collect();
    let thin = |[u, v]: [f32; 2]| [u, v, 0.01 * u.min(v)];
    let width = asset.sh.len() / asset.num_splats().max(1);
    let sh0 = (0..asset.num_splats()).flat_map(|i| asset.sh[i * width..][..3].to_vec()).collect();
    let sizes = asset.maps.iter().flat_map(|m| m.texel_sizes).collect();
    let arrays = [
        ("textured/positions", floats(positions)),
        ("textured/orientations", floats(rotations)),
        ("textured/scales", floats(asset.scales.iter().flat_map(|&[u, v]| [u, v, 0.0]).collect())),
        ("textured/opacities", floats(asset.opacities.clone())),
        ("textured/primvars:litetex:sh0", floats(sh0)),
        ("textured/primvars:litetex:texelSize", floats(sizes)),
        ("splat3d/scales", floats(asset.scales.iter().flat_map(|&s| thin(s)).collect())),
        ("splat3d/opacities", floats(asset.opacities.clone())),
    ];
    arrays.into_iter().map(|(name, bytes)| (name.to_owned(), super::package::crc32(&bytes).into())).collect()
}

fn layer_of(asset: &SplatAsset) -> Layer {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "s.usdc", asset, Quality::Balanced);
    Opened::open(&path, &ReadLimits::default()).unwrap().layer
}

#[test]
fn text_and_binary_hold_the_same_layer() {
    let layer = layer_of(&full(40, 2));
    let text = text_from_layer(&layer);
    let from_text = layer_from_text(&text, Path::new("t"), 64 << 20).unwrap().layer;
    assert_eq!(from_text, layer);
    let bytes = binary_from_layer(&from_text);
    let limits = ReadLimits::default();
    assert_eq!(layer_from_binary(&bytes, Path::new("b"), &limits).unwrap().layer, layer);
    assert_eq!(binary_from_layer(&layer), bytes, "reproducible");
    // Negative control: another sign of a zero is another layer.
    let changed = text.replacen("-0.0", "0.0", 1);
    assert_ne!(text_from_layer(&layer_from_text(&changed, Path::new("t"), 64 << 20).unwrap().layer), text);
    // White space does not matter; comments are not ours.
    let loose = text.replacen("#usda 1.0\n", "#usda 1.0\r\n", 1).replace("\n    ", "\n\t  ");
    assert_eq!(layer_from_text(&loose, Path::new("t"), 64 << 20).unwrap().layer, layer);
    let commented = text.replacen("\n    ", "\n    # x\n", 1);
    let error = layer_from_text(&commented, Path::new("t"), 64 << 20).unwrap_err();
    assert!(
        matches!(&error, Error::Unsupported { what, .. } if what.contains("line 3: a comment")),
        "{error}"
    );
}

#[test]
fn balanced_files_round_only_texels_by_half_a_step() {
    let folder = tempfile::tempdir().unwrap();
    let asset = full(100, 1);
    let step = TexelDecode::finest(&asset.texels).scale as f32;
    let mut decoded = Vec::new();
    for extension in EXTENSIONS {
        let path = write(folder.path(), &format!("b.{extension}"), &asset, Quality::Balanced);
        let contents = read(&path).unwrap();
        assert_eq!(contents.warnings, Vec::<String>::new());
        let same = SplatAsset { texels: asset.texels.clone(), ..contents.asset.clone() };
        assert_eq!(same, asset);
        let pairs = contents.asset.texels.iter().zip(&asset.texels);
        let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        // Needed 0.5 steps and rounding; a quarter would not do.
        assert!(worst <= 0.5001 * step && worst > 0.25 * step, "{worst} of {step}");
        decoded.push(contents.asset);
        // Equal input makes equal bytes.
        let before = std::fs::read(&path).unwrap();
        write(folder.path(), &format!("b.{extension}"), &asset, Quality::Balanced);
        assert_eq!(std::fs::read(&path).unwrap(), before);
    }
    assert_eq!(decoded[0], decoded[1]);
    assert_eq!(decoded[1], decoded[2]);
}

#[test]
fn the_hash_reveals_changed_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "s.usda", &full(9, 0), Quality::Lossless);
    assert_eq!(validate(&path), Vec::new());
    let text = std::fs::read_to_string(&path).unwrap();
    let at = text.find("float[] opacities = [").unwrap() + "float[] opacities = [".len();
    let end = at + text[at..].find(',').unwrap();
    let changed = format!("{}0.5{}", &text[..at], &text[end..]);
    std::fs::write(&path, changed).unwrap();
    let contents = read(&path).unwrap();
    assert!(contents.warnings[0].contains("hash"), "{:?}", contents.warnings);
    assert_eq!(validate(&path)[0].code, "LT2009");
    std::fs::write(
        &path,
        text.replacen("(1000000", "(2000000", 1).replacen("translate = (1", "translate = (2", 1),
    )
    .unwrap();
    let warnings = read(&path).unwrap().warnings;
    assert!(warnings.len() == 1 && warnings[0].contains("transformation"), "{warnings:?}");
}

#[test]
fn validation_reports_every_broken_rule() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "s.usda", &full(9, 0), Quality::Balanced);
    let text = std::fs::read_to_string(&path).unwrap();
    let surflet = "\"ParticleFieldKernelGaussianSurfletAPI\", ";
    let ellipsoid = "\"ParticleFieldKernelGaussianEllipsoidAPI\", ";
    let value = |name: &str| {
        let at = text.find(name).unwrap() + name.len();
        (at, at + text[at..].find(')').unwrap_or(0))
    };
    let replaced_first = |name: &str, new: &str| {
        let (at, end) = value(name);
        format!("{}{new}{}", &text[..at], &text[end + 1..])
    };
    let cases = [
        ("LT2001", text.replacen("def Xform", "def Xform \"", 1)),
        ("LT2002", replaced_first("positions = [", "(0, 0, 0), (0, 0, 0)")),
        ("LT2003", text.replacen(surflet, "", 1)),
        ("LT2004", text.replacen(surflet, &format!("{surflet}{ellipsoid}"), 1)),
        ("LT2005", replaced_first("positions = [", "(nan, 0, 0)")),
        ("LT2006", replaced_first("positions = [", "(0, 99, 0)")),
        ("LT2006", text.replace("float3[] extent", "float3[] unextent")),
        ("LT2007", text.replacen(surflet, &format!("{surflet}\"ParticleFieldColourAPI\", "), 1)),
        ("LT2008", replaced_first("litetex:rect = [", "(4, 0, 99, 2)")),
        ("LT2008", replaced_first("litetex:rect = [", "(0, 0, 3, 5)")),
        ("LT2009", text.replacen("string hash = \"", "string hash = \"f", 1)),
        ("LT2010", text.replacen("upAxis = \"Y\"", "", 1)),
        ("LT2010", text.replacen("defaultPrim = \"Scene\"", "defaultPrim = \"None\"", 1)),
        ("LT2011", replaced_first("orientations = [", "(0, 0, 0, 0)")),
    ];
    for (code, changed) in cases {
        assert_ne!(changed, text, "{code}");
        std::fs::write(&path, changed).unwrap();
        let issues = validate(&path);
        assert!(issues.iter().any(|i| i.code == code && i.severity == Severity::Error), "{code}: {issues:?}");
    }
    std::fs::write(&path, &text).unwrap();
    assert_eq!(validate(&path), Vec::new());
}

#[test]
fn a_broken_fallback_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    for quality in [Quality::Lossless, Quality::Balanced] {
        let path = write(folder.path(), "f.usda", &full(9, 0), quality);
        let text = std::fs::read_to_string(&path).unwrap();
        let replaced = |at: usize, new: &str| {
            let end = at + text[at..].find(')').unwrap() + 1;
            std::fs::write(&path, format!("{}{new}{}", &text[..at], &text[end..])).unwrap();
            let mut codes: Vec<_> = validate(&path).into_iter().map(|i| i.code).collect();
            codes.dedup();
            codes
        };
        // The textured splats come first, those for programs without texture support last.
        let name = "sphericalHarmonicsCoefficients = [";
        let (first, last) = (text.find(name).unwrap(), text.rfind(name).unwrap());
        assert!(first < last);
        // The hash does not cover the fallback.
        assert_eq!(replaced(first + name.len(), "(5, 5, 5)"), ["LT2013", "LT2015"]);
        assert_eq!(replaced(last + name.len(), "(5, 5, 5)"), ["LT2013", "LT2015"]);
        let scales = text.rfind("float3[] scales = [").unwrap() + "float3[] scales = [".len();
        assert_eq!(replaced(scales, "(0.01, 0.01, 1000)"), ["LT2014"]);
        assert_eq!(replaced(scales, "(0.01, 0.01, 0)"), ["LT2014"]);
        let opacities = text.rfind("float[] opacities = [").unwrap() + "float[] opacities = [".len();
        let end = opacities + text[opacities..].find(',').unwrap();
        std::fs::write(&path, format!("{}0.5{}", &text[..opacities], &text[end..])).unwrap();
        assert_eq!(validate(&path)[0].code, "LT2015");
        std::fs::write(&path, &text).unwrap();
        assert_eq!(validate(&path), Vec::new(), "negative control");
    }
}

#[test]
fn pages_are_found_by_the_paths_in_the_layer() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "s.usda", &full(9, 0), Quality::Balanced);
    let before = read(&path).unwrap().asset;
    std::fs::rename(folder.path().join("s_usda_textures"), folder.path().join("s_textures")).unwrap();
    assert!(read(&path).is_err(), "negative control");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("./s_usda_textures/", "./s_textures/")).unwrap();
    assert_eq!(read(&path).unwrap().asset, before);
    assert_eq!(validate(&path), Vec::new());
}

#[test]
fn splats_near_the_f32_limit_make_valid_files() {
    let folder = tempfile::tempdir().unwrap();
    for far in [1e38, f32::MAX] {
        let mut asset = full(9, 0);
        asset.positions[2] = [far, -far, far];
        asset.scales[2] = [1e6, 1e6];
        for extension in EXTENSIONS {
            let path = write(folder.path(), &format!("far.{extension}"), &asset, Quality::Lossless);
            assert_eq!(validate(&path), Vec::new(), "{extension} {far}");
            assert_eq!(read(&path).unwrap().asset, asset);
        }
    }
}

#[test]
fn bytes_by_attribute_add_up() {
    let folder = tempfile::tempdir().unwrap();
    let asset = full(200, 1);
    for extension in EXTENSIONS {
        let path = write(folder.path(), &format!("b.{extension}"), &asset, Quality::Balanced);
        let contents = read(&path).unwrap();
        let of = |name: &str| contents.sections.iter().find(|s| s.name == name).map_or(0, |s| s.bytes);
        let pages: u64 = contents.sections.iter().map(|s| s.bytes).sum();
        let file = std::fs::metadata(&path).unwrap().len();
        assert!(
            if extension == "usdz" { pages == file } else { pages > file },
            "{extension}: {pages} {file}"
        );
        for name in ["positions", "rotations", "scales", "opacities", "sh", "sh0", "maps"] {
            // Text takes about ten characters per number.
            assert!(of(name) >= 4 * 200, "{extension} {name}: {:?}", contents.sections);
        }
        if extension == "usda" {
            let text = std::fs::read_to_string(&path).unwrap();
            let start = text.find("quatf[] orientations").unwrap();
            let line = text[start..].lines().next().unwrap().len() as u64;
            assert_eq!(of("rotations"), line);
            assert!(of("text") < file / 10, "{:?}", contents.sections);
        }
    }
}
