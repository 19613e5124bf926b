//! Every valid asset round-trips through every format: bit for bit where the format guarantees it, within bounds elsewhere. Every damaged
//! file gives an error or a valid asset.

use litetex_exporters::{
    AssetMap, Contents, Format, METRES, Provenance, Quality, ReadLimits, SplatAsset, Transform,
    UNKNOWN_SCALE, WriteOptions, ltgs, num_sh_coefficients, read_asset, read_fallback, validate_file,
    write_asset,
};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::ValueTree as _;
use std::collections::BTreeMap;
use std::path::Path;

/// Numbers that are easily lost: zeros of both signs, subnormal and large numbers.
fn number() -> impl Strategy<Value = f32> {
    use proptest::num::f32::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    prop_oneof![
        4 => -2.0_f32..2.0,
        1 => POSITIVE | NEGATIVE | SUBNORMAL | ZERO,
        1 => (POSITIVE | NEGATIVE | NORMAL).prop_map(|v| v.clamp(-1e30, 1e30)),
    ]
}

/// Positive ones up to a limit.
fn positive(most: f32) -> impl Strategy<Value = f32> {
    use proptest::num::f32::{NORMAL, POSITIVE, SUBNORMAL};
    prop_oneof![
        4 => 0.001_f32..1.0,
        1 => (POSITIVE | NORMAL | SUBNORMAL).prop_map(move |v| v.clamp(f32::from_bits(1), most)),
    ]
    .prop_map(move |v| v.min(most))
}

fn quaternion() -> impl Strategy<Value = [f64; 4]> {
    prop::array::uniform4(-1.0_f64..1.0).prop_filter_map("no length", |q| {
        let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        (norm > 1e-3).then(|| q.map(|v| v / norm))
    })
}

#[derive(Clone, Debug)]
struct Splat {
    position: [f32; 3],
    rotation: [f64; 4],
    scales: [f32; 2],
    opacity: f32,
    degree: u8,
    sh: Vec<f32>,
    texel_sizes: [f32; 2],
    shift: [i16; 2],
    sides: [u16; 2],
    texels: Vec<f32>,
}

/// `is_tame` restricts numbers to those of real scenes, for formats that round.
fn splat(sh_degree: u32, is_tame: bool) -> impl Strategy<Value = Splat> {
    let tame = move |strategy: BoxedStrategy<f32>| if is_tame { (-1.0_f32..1.0).boxed() } else { strategy };
    let size = move || if is_tame { (0.005_f32..0.5).boxed() } else { positive(1e6).boxed() };
    let texel_sizes = prop_oneof![
        size().prop_map(|k| [k; 2]),
        size().prop_map(|k| [k, (2.0 * k).min(1e6)]),
        prop::array::uniform2(size()),
    ];
    let shift = prop_oneof![
        2 => Just([0; 2]),
        2 => prop::array::uniform2(-9_i16..=9),
        1 => prop::array::uniform2(any::<i16>()),
    ];
    let sides = prop_oneof![Just([0, 0]), prop::array::uniform2(1_u16..6)];
    let all = (
        prop::array::uniform3(tame(number().boxed())),
        quaternion(),
        prop::array::uniform2(size()),
        if is_tame { (0.01_f32..1.0).boxed() } else { positive(1.0).boxed() },
        (0..=sh_degree).prop_flat_map(move |degree| {
            (Just(degree as u8), vec(tame(number().boxed()), 3 * num_sh_coefficients(degree)))
        }),
        texel_sizes,
        shift,
        sides,
    );
    all.prop_flat_map(
        move |(position, rotation, scales, opacity, (degree, sh), texel_sizes, shift, sides)| {
            let count = 3 * usize::from(sides[0]) * usize::from(sides[1]);
            let texel = if is_tame {
                (-1.0_f32..=1.0).boxed()
            } else {
                number().prop_map(|v| v.clamp(-1.0, 1.0)).boxed()
            };
            vec(texel, count).prop_map(move |texels| Splat {
                position,
                rotation,
                scales,
                opacity,
                degree,
                sh: sh.clone(),
                texel_sizes,
                shift,
                sides,
                texels,
            })
        },
    )
}

fn asset(is_tame: bool) -> impl Strategy<Value = SplatAsset> {
    let frame = (1e-3_f64..1e3, quaternion(), prop::array::uniform3(-1e3_f64..1e3));
    let splats = (0_u32..=3).prop_flat_map(move |degree| (Just(degree), vec(splat(degree, is_tame), 1..12)));
    let scale = prop_oneof![
        Just(String::new()),
        Just(UNKNOWN_SCALE.to_owned()),
        Just(format!("{METRES}: 1.2 m between two points (é.jpg:1,2 a b.png:3,4 = 1.2m)"))
    ];
    (splats, frame, "\\PC{0,12}", scale, 0.0_f32..1.0).prop_map(
        |((sh_degree, splats), frame, title, said, near)| {
            let (scale, rotation, translation) = frame;
            let mut asset = SplatAsset {
                sh_degree,
                near,
                capture_from_local: Transform { scale, rotation, translation },
                ..SplatAsset::default()
            };
            asset.provenance.title = title;
            asset.provenance.scale = said;
            for splat in splats {
                let [rows, cols] = splat.sides;
                let mut map = AssetMap { offset_texels: asset.num_texels() as u32, ..AssetMap::default() };
                if rows > 0 {
                    map = AssetMap { rows, cols, texel_sizes: splat.texel_sizes, shift: splat.shift, ..map };
                }
                asset.maps.push(map);
                asset.texels.extend(splat.texels);
                asset.positions.push(splat.position);
                asset.rotations.push(splat.rotation.map(|v| v as f32));
                asset.scales.push(splat.scales);
                asset.opacities.push(splat.opacity);
                asset.sh_degrees.push(splat.degree);
                asset.sh.extend(splat.sh);
                asset.sh.resize(asset.num_splats() * 3 * num_sh_coefficients(sh_degree), 0.0);
            }
            asset.fit_sh_degree();
            asset.validate().expect("a valid asset");
            asset
        },
    )
}

fn options(quality: Quality) -> WriteOptions<'static> {
    WriteOptions { quality, ..WriteOptions::default() }
}

fn through(folder: &Path, asset: &SplatAsset, format: Format, quality: Quality) -> Contents {
    let path = folder.join("scene").with_extension(format.extension());
    write_asset(&path, asset, &options(quality)).expect("written");
    let issues = validate_file(&path).expect("looked at");
    let errors: Vec<_> = issues.iter().filter(|i| i.severity == litetex_exporters::Severity::Error).collect();
    assert!(errors.is_empty(), "{format:?}: {errors:?}");
    read_asset(&path, &ReadLimits::default()).expect("read")
}

/// Largest difference of two lists.
fn apart(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).fold(0.0, f64::max)
}

/// SH as PLY files hold them: of degree 0 or 3, with zeros for what an asset of degree 1 or 2 lacks.
fn in_degree_0_or_3(asset: &SplatAsset) -> Vec<f32> {
    let own = 3 * num_sh_coefficients(asset.sh_degree);
    let zeros = if asset.sh_degree == 0 { 0 } else { 3 * num_sh_coefficients(3) - own };
    asset
        .sh
        .chunks_exact(own)
        .flat_map(|sh| sh.iter().copied().chain(std::iter::repeat_n(0.0, zeros)))
        .collect()
}

const TEXTURED: [Format; 7] =
    [Format::Glb, Format::Gltf, Format::Ltgs, Format::Html, Format::Usda, Format::Usdc, Format::Usdz];

fn config(cases: u32) -> ProptestConfig {
    // No regression files next to the sources: failures become tests of their own.
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config(96))]

    #[test]
    fn lossless_files_round_trip_bit_for_bit(asset in asset(false)) {
        let folder = tempfile::tempdir().expect("a folder");
        for format in TEXTURED {
            let read = through(folder.path(), &asset, format, Quality::Lossless);
            // The hash covers the signs of zeros, the comparison what is not rendered.
            prop_assert_eq!(read.asset.hash(), asset.hash(), "{:?}", format);
            prop_assert_eq!(&read.asset, &asset, "{:?}", format);
        }
    }

    #[test]
    fn balanced_pages_keep_texels_to_half_a_step(asset in asset(false)) {
        let folder = tempfile::tempdir().expect("a folder");
        let largest = asset.texels.iter().fold(0.0_f64, |a, t| a.max(f64::from(t.abs())));
        for format in [Format::Glb, Format::Usdc] {
            let read = through(folder.path(), &asset, format, Quality::Balanced).asset;
            let texels = apart(&read.texels, &asset.texels);
            // Half a step, and the rounding of f32.
            prop_assert!(texels <= 0.5001 * largest / 127.0 + 1e-38, "{:?}: {} of {}", format, texels, largest);
            let same = SplatAsset { texels: asset.texels.clone(), ..read };
            prop_assert_eq!(same.hash(), asset.hash(), "{:?}", format);
        }
    }

    #[test]
    fn ltgs_files_decode_to_the_quantised_asset(asset in asset(true), exponents in vec(-8_i8..=8, 0..40)) {
        let per_splat = ltgs::PerSplat { exponents: &exponents, ..ltgs::PerSplat::default() };
        for (quality, steps) in [
            (Quality::Balanced, ltgs::Steps::balanced()),
            (Quality::Tiny, ltgs::Steps::tiny()),
        ] {
            let options = ltgs::LtgsOptions { quality, steps: Some(steps), per_splat, ..ltgs::LtgsOptions::default() };
            let bytes = ltgs::encode(&asset, &options).expect("written");
            let read = ltgs::decode(&bytes, Path::new("a"), &ReadLimits::default()).expect("read").asset;
            let promised = ltgs::quantised(&asset, &steps, per_splat).expect("rounded");
            prop_assert_eq!(read.hash(), promised.hash());
            prop_assert_eq!((read.num_splats(), read.num_texels()), (asset.num_splats(), asset.num_texels()));
        }
    }

    #[test]
    fn plain_formats_keep_splats_to_their_steps(asset in asset(true)) {
        let folder = tempfile::tempdir().expect("a folder");
        let expected = asset.untextured().in_frame(&Transform::IDENTITY);
        let ply = through(folder.path(), &asset, Format::Ply, Quality::Balanced).asset;
        let far = 2e3 + 1.0;
        // f32 of places up to 2,000 units out needs 6e-5, of SH after a turn 4e-7.
        prop_assert!(apart(ply.positions.as_flattened(), expected.positions.as_flattened()) < far * 2.4e-7);
        prop_assert!(apart(&ply.sh, &in_degree_0_or_3(&expected)) < 1e-5);
        prop_assert!(apart(&ply.opacities, &expected.opacities) < 1e-6);
        prop_assert_eq!(&ply.provenance, &asset.provenance);
        let spz = through(folder.path(), &asset, Format::Spz, Quality::Balanced).asset;
        // 24 bits for places, steps of 8 bits for the rest, of SH inside what they reach.
        prop_assert!(apart(spz.positions.as_flattened(), expected.positions.as_flattened()) < 1e-3);
        prop_assert!(apart(&spz.opacities, &expected.opacities) < 0.51 / 255.0);
        let kept = Provenance { training: BTreeMap::new(), ..asset.provenance.clone() };
        prop_assert_eq!(&spz.provenance, &kept);
        prop_assert_eq!((ply.num_splats(), spz.num_splats()), (asset.num_splats(), asset.num_splats()));
    }

    #[test]
    fn damaged_files_are_errors_or_valid_assets(
        asset in asset(true),
        edits in vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let folder = tempfile::tempdir().expect("a folder");
        for format in Format::ALL {
            let path = folder.path().join("scene").with_extension(format.extension());
            write_asset(&path, &asset, &options(Quality::Balanced)).expect("written");
            let mut bytes = std::fs::read(&path).expect("read");
            for (at, value) in &edits {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            std::fs::write(&path, &bytes).expect("written");
            let limits = ReadLimits { decoded_bytes: 64 << 20, layers: None };
            if let Ok(contents) = read_asset(&path, &limits) {
                contents.asset.validate().expect("what is read is valid");
            }
            if let Ok(Some(fallback)) = read_fallback(&path, &limits) {
                fallback.validate().expect("what is read is valid");
            }
            prop_assert!(validate_file(&path).is_ok());
        }
    }
}

#[test]
fn comparisons_detect_a_single_bit() {
    // Negative control of the properties above.
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let asset = asset(false).new_tree(&mut runner).expect("an asset").current();
    let mut changed = asset.clone();
    changed.sh[0] = f32::from_bits(changed.sh[0].to_bits() ^ 1);
    assert_ne!(changed.hash(), asset.hash());
    assert!(apart(&[1.0, 2.0], &[1.0, 2.5]) == 0.5);
}
