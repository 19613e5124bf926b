//! Writer and reader against each other and against damage.

use super::*;
use crate::asset::tests::fixture;
use crate::baked::Baker;
use crate::{Contents, Error, ReadLimits, SplatAsset};
use std::path::Path;

fn decode(bytes: &[u8]) -> crate::Result<Contents> {
    decode_spz(bytes, Path::new("test.spz"), &ReadLimits::default())
}

/// Largest differences of centres, scales (relative), opacities, DC, other SH, in units of the codes' steps.
fn differences(asset: &SplatAsset, read: &SplatAsset) -> [f64; 5] {
    let (baker, mut worst) = (Baker::new(asset), [0.0_f64; 5]);
    for i in 0..asset.num_splats() {
        let baked = baker.splat(i);
        let mut at =
            |k: usize, a: f64, b: f32, step: f64| worst[k] = worst[k].max((a - f64::from(b)).abs() / step);
        for c in 0..3 {
            at(0, baked.position[c], read.positions[i][c], 1.0 / 524_288.0);
        }
        for c in 0..2 {
            at(1, baked.scales[c].ln(), read.scales[i][c].ln(), 1.0 / 16.0);
        }
        at(2, baked.opacity.into(), read.opacities[i], 1.0 / 255.0);
        for (k, (a, b)) in baked.sh.iter().zip(read.sh_of(i)).enumerate() {
            let step = if k < 3 { 1.0 / 255.0 / COLOUR_SCALE } else { sh_step(k / 3) / 128.0 };
            at(if k < 3 { 3 } else { 4 }, *a, *b, step);
        }
    }
    worst
}

#[test]
fn splats_round_trip_within_half_a_step() {
    for degree in 0..=3 {
        let mut asset = fixture(30, degree);
        asset.capture_from_local.rotation = [0.5, -0.1, 0.7, 0.5];
        let (bytes, summary) = encode_spz(&asset).unwrap();
        assert_eq!((summary.bytes, summary.averaged_maps, summary.clamped_scales), (bytes.len(), 20, 0));
        assert!(summary.position_error_texels > 0.0 && summary.position_error_texels < 1e-4);
        let read = decode(&bytes).unwrap();
        assert_eq!(read.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        assert_eq!(read.asset.provenance, asset.provenance);
        assert!(read.warnings.is_empty(), "{:?}", read.warnings);
        let worst = differences(&asset, &read.asset);
        assert!(worst.iter().all(|w| *w < 0.51), "{worst:?}"); // needed 0.4997: half a step
        let baker = Baker::new(&asset);
        for (i, found) in read.asset.rotations.iter().enumerate() {
            let q = baker.splat(i).rotation;
            let cosine: f32 = (0..4).map(|k| q[k] * found[k]).sum();
            assert!(cosine.abs() > 0.999_99, "{q:?} {found:?}"); // needed 0.999_998_8
        }
        // Negative controls: a mirrored frame, and a stream of another splat.
        let mut mirrored = read.asset.clone();
        mirrored.positions.iter_mut().for_each(|p| p[1] = -p[1]);
        assert!(differences(&asset, &mirrored)[0] > 100.0);
    }
}

#[test]
fn damaged_files_and_other_versions_are_reported() {
    let (bytes, _) = encode_spz(&fixture(40, 2)).unwrap();
    for cut in 0..100 {
        assert!(decode(&bytes[..bytes.len() * cut / 100]).is_err(), "cut to {cut} %");
    }
    let mut state = 5_u32;
    for _ in 0..2_000 {
        let mut damaged = bytes.clone();
        for _ in 0..3 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = state as usize % damaged.len();
            damaged[at] ^= 1 << (state >> 29);
        }
        if let Ok(contents) = decode(&damaged) {
            contents.asset.validate().unwrap();
        }
    }
    let with = |at: usize, word: u32| {
        let mut changed = bytes.clone();
        changed[at..at + 4].copy_from_slice(&word.to_le_bytes());
        decode(&changed).unwrap_err()
    };
    assert!(matches!(with(4, 5), Error::Unsupported { .. }));
    assert!(matches!(with(8, u32::MAX), Error::TooLarge { .. }));
    assert!(matches!(with(8, 1 << 23), Error::Invalid { .. }), "more splats than there are bytes");
    assert!(matches!(with(16, u32::MAX), Error::Invalid { .. }));
    assert!(matches!(decode(&[0x1f, 0x8b, 8, 0]), Err(Error::Unsupported { .. })));
    let small = ReadLimits { decoded_bytes: 100, layers: None };
    assert!(matches!(decode_spz(&bytes, Path::new("x"), &small), Err(Error::TooLarge { .. })));
}

#[test]
fn splats_out_of_range_are_refused_or_counted() {
    let mut asset = fixture(4, 0);
    asset.scales[1] = [1e-7, 0.1];
    assert_eq!(encode_spz(&asset).unwrap().1.clamped_scales, 1);
    asset.capture_from_local.translation[2] = 1e7;
    assert!(encode_spz(&asset).unwrap_err().to_string().contains("origin"));
}

/// A file with streams of zeros, padded by frames that zstd skips.
fn zeros(num_splats: usize, packed_share: usize) -> Vec<u8> {
    let mut streams = Vec::new();
    for width in [9, 1, 3, 3, 4, 45] {
        let raw = width * num_splats;
        // Frames of zeros one after another: nothing large is made here.
        let mut stream =
            zstd::bulk::compress(&vec![0; raw.min(1 << 20)], 1).unwrap().repeat(raw.div_ceil(1 << 20));
        let padding = (raw / packed_share).saturating_sub(stream.len() + 8);
        stream.extend(0x184d_2a50_u32.to_le_bytes());
        stream.extend((padding as u32).to_le_bytes());
        stream.resize(stream.len() + padding, 0);
        streams.push((raw, stream));
    }
    let mut bytes = b"NGSP".to_vec();
    bytes.extend([4, num_splats as u32].iter().flat_map(|w| w.to_le_bytes()));
    bytes.extend([3, 12, 0, 6, 32, 0, 0, 0]);
    bytes.resize(32, 0);
    for (raw, stream) in &streams {
        bytes.extend([stream.len(), *raw].iter().flat_map(|&w| (w as u64).to_le_bytes()));
    }
    bytes.extend(streams.into_iter().flat_map(|(_, s)| s));
    bytes
}

#[test]
fn decompression_bombs_are_refused() {
    // As many splats as there may be: more than the limit on what is decoded.
    let bomb = zeros(1 << 24, 4096);
    assert!(bomb.len() < 400_000, "{}", bomb.len());
    assert!(matches!(decode(&bomb), Err(Error::TooLarge { .. })));
    // Fewer: within that limit, but no scene compresses so well.
    let error = decode(&zeros(1 << 20, 4096)).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }) && error.to_string().contains("at most"), "{error}");
    // Negative control: a few alike splats are read, and padded by honest bytes more of them.
    assert_eq!(decode(&zeros(1000, 4096)).unwrap().asset.num_splats(), 1000);
    assert_eq!(decode(&zeros(1 << 20, 40)).unwrap().asset.num_splats(), 1 << 20);
}

#[test]
fn cameras_round_trip_in_the_capture_frame() {
    let mut asset = fixture(10, 0);
    asset.near = 0.04;
    asset.cameras.push(crate::AssetCamera {
        name: "a".into(),
        held_out: true,
        width_px: 40,
        height_px: 30,
        focal_px: [35.0, 36.0],
        principal_px: [20.0, 15.0],
        rotation_rows: [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]],
        translation: [0.1, 0.2, 4.0],
    });
    let read = decode(&encode_spz(&asset).unwrap().0).unwrap().asset;
    assert_eq!(read.cameras.len(), 1);
    let back = read.cameras[0].in_frame(&asset.capture_from_local.inverse().after(&read.capture_from_local));
    for (a, b) in back.translation.iter().zip(asset.cameras[0].translation) {
        assert!((a - b).abs() < 1e-12, "{a} {b}"); // needed 9e-16
    }
    // 3.7 units of the capture are one of the asset's.
    assert!((read.near - 0.04 * 3.7).abs() < 1e-7, "{}", read.near);
    assert!(
        (read.cameras[0].translation[2] - asset.cameras[0].translation[2]).abs() > 1.0,
        "negative control"
    );
}

#[test]
fn validation_reports_damaged_metadata_and_odd_splats() {
    let (bytes, _) = encode_spz(&fixture(40, 1)).unwrap();
    let codes = |bytes: &[u8]| -> Vec<_> {
        validate(bytes, Path::new("x")).into_iter().map(|i| (i.code, i.severity)).collect()
    };
    assert_eq!(codes(&bytes), []);
    let mut damaged = bytes.clone();
    damaged[HEADER_BYTES + 8] = b'[';
    assert_eq!(codes(&damaged), [("LT4010", crate::Severity::Warning)]);
    assert_eq!(codes(&bytes[..60])[0].0, "LT4001");
    let mut asset = fixture(40, 1);
    asset.opacities[3] = 0.001;
    asset.positions[7] = [1e4, 0.0, 0.0];
    let found = codes(&encode_spz(&asset).unwrap().0);
    assert_eq!(found, [("LT4006", crate::Severity::Info), ("LT4007", crate::Severity::Warning)]);
}
