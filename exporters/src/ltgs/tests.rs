//! Writer and reader against each other and against damage.

use super::*;
use crate::asset::tests::fixture;
use crate::{AssetCamera, Error, Quality, ReadLimits, SplatAsset};
use std::path::Path;

const PATH: &str = "test.ltgs";

fn limits() -> ReadLimits {
    ReadLimits { decoded_bytes: 64 << 20 }
}

fn read(bytes: &[u8]) -> crate::Result<crate::Contents> {
    decode(bytes, Path::new(PATH), &limits())
}

fn options(quality: Quality) -> LtgsOptions {
    LtgsOptions { quality, steps: None }
}

/// The fixture with a camera and awkward numbers.
fn awkward(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut asset = fixture(num_splats, sh_degree);
    asset.cameras.push(AssetCamera {
        name: "a.png".to_owned(),
        width_px: 640,
        height_px: 480,
        focal_px: [500.0, 510.0],
        principal_px: [320.0, 240.0],
        rotation_rows: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation: [0.1, -0.2, 2.0],
    });
    asset.near = 0.03;
    asset.background = [0.25, 0.5, 1.0];
    asset
}

/// Whether two assets are the same in every bit.
fn is_same(a: &SplatAsset, b: &SplatAsset) -> bool {
    let bits = |a: &SplatAsset| {
        let mut bits: Vec<u32> = Vec::new();
        for values in [a.positions.as_flattened(), a.rotations.as_flattened(), a.scales.as_flattened()] {
            bits.extend(values.iter().map(|v| v.to_bits()));
        }
        for values in [&a.opacities, &a.sh, &a.texels] {
            bits.extend(values.iter().map(|v| v.to_bits()));
        }
        bits.extend(a.maps.iter().map(|m| m.texel_size.to_bits()));
        bits
    };
    a == b && bits(a) == bits(b)
}

#[test]
fn lossless_keeps_every_bit_and_the_order() {
    for (num_splats, degree) in [(0, 0), (1, 1), (3, 2), (4096, 0), (4100, 0), (50, 3)] {
        let mut asset = awkward(num_splats, degree);
        if num_splats == 50 {
            asset.positions[3] = [-0.0, f32::MIN_POSITIVE, 1e-44];
            asset.sh[5] = -0.0;
            asset.texels[4] = -0.0;
            asset.scales[7] = [1e-44, 1e6];
        }
        let bytes = encode(&asset, &options(Quality::Lossless)).unwrap();
        let contents = read(&bytes).unwrap();
        assert!(is_same(&contents.asset, &asset), "{num_splats} splats");
        assert_eq!(contents.hash, Some(asset.hash()));
        assert_eq!(contents.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        assert!(validate(&bytes, Path::new(PATH)).is_empty());
        if num_splats > 0 {
            // Negative control.
            let mut other = contents.asset;
            other.positions[0][0] = f32::from_bits(other.positions[0][0].to_bits() ^ 1);
            assert!(!is_same(&other, &asset));
        }
    }
}

#[test]
fn lossy_files_hold_exactly_what_quantised_says() {
    for quality in [Quality::Balanced, Quality::Tiny] {
        for (num_splats, degree) in [(0, 3), (1, 0), (5000, 1), (300, 3)] {
            let asset = awkward(num_splats, degree);
            let steps = if quality == Quality::Tiny { Steps::tiny(&asset) } else { Steps::balanced(&asset) };
            for factor in [1.0, 0.01, 3.7] {
                let steps = steps.scaled(factor);
                let bytes = encode(&asset, &LtgsOptions { quality, steps: Some(steps) }).unwrap();
                let contents = read(&bytes).unwrap();
                let expected = quantised(&asset, &steps).unwrap();
                assert!(is_same(&contents.asset, &expected), "{num_splats} splats, factor {factor}");
                expected.validate().unwrap();
                assert_eq!(contents.hash, Some(expected.hash()));
                assert_eq!(contents.quality, Some(quality));
                assert_eq!(contents.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
                assert!(validate(&bytes, Path::new(PATH)).is_empty());
                assert_eq!(contents.asset.cameras, asset.cameras);
            }
            let again = encode(&asset, &options(quality)).unwrap();
            assert_eq!(encode(&asset, &options(quality)).unwrap(), again, "the same bytes always");
        }
    }
}
