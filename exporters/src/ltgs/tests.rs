//! Round trips and damaged files.

use super::*;
use crate::asset::tests::{camera, damaged, fixture, random};
use crate::{Error, Quality, ReadLimits, SplatAsset};
use std::path::Path;

mod layers;
mod stand_in;

const PATH: &str = "test.ltgs";

fn limits() -> ReadLimits {
    ReadLimits { decoded_bytes: 64 << 20, layers: None }
}

fn read(bytes: &[u8]) -> crate::Result<crate::Contents> {
    decode(bytes, Path::new(PATH), &limits())
}

fn options(quality: Quality) -> LtgsOptions<'static> {
    LtgsOptions { quality, ..LtgsOptions::default() }
}

/// The fixture with a camera and awkward numbers.
fn awkward(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut asset = fixture(num_splats, sh_degree);
    asset.cameras.push(crate::AssetCamera { translation: [0.1, -0.2, 2.0], ..camera() });
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
        bits.extend(a.maps.iter().flat_map(|m| m.texel_sizes).map(f32::to_bits));
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
        let quick = LtgsOptions { effort: Effort::Quick, ..options(Quality::Lossless) };
        let quick = encode(&asset, &quick).unwrap();
        assert!(is_same(&read(&quick).unwrap().asset, &asset) && quick.len() >= bytes.len());
        if num_splats > 0 {
            // Negative control.
            let mut other = contents.asset;
            other.positions[0][0] = f32::from_bits(other.positions[0][0].to_bits() ^ 1);
            assert!(!is_same(&other, &asset));
        }
    }
}

#[test]
fn lossy_files_decode_to_the_quantised_asset() {
    for quality in [Quality::Balanced, Quality::Tiny] {
        for (num_splats, degree) in [(0, 3), (1, 0), (5000, 1), (300, 3)] {
            let asset = awkward(num_splats, degree);
            let steps = if quality == Quality::Tiny { Steps::tiny() } else { Steps::balanced() };
            for factor in [1.0, 0.01, 3.7] {
                let steps = steps.scaled(factor);
                let bytes =
                    encode(&asset, &LtgsOptions { quality, steps: Some(steps), ..LtgsOptions::default() })
                        .unwrap();
                let contents = read(&bytes).unwrap();
                let expected = quantised(&asset, &steps, PerSplat::default()).unwrap();
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

#[test]
fn a_second_encoding_changes_next_to_nothing() {
    let off = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    for (quality, other) in [(Quality::Balanced, Quality::Tiny), (Quality::Tiny, Quality::Balanced)] {
        let bytes = encode(&awkward(3000, 2), &options(quality)).unwrap();
        let once = read(&bytes).unwrap().asset;
        let again = encode(&once, &options(quality)).unwrap();
        let twice = read(&again).unwrap().asset;
        assert!(bytes.len().abs_diff(again.len()) < 10, "{} {}", bytes.len(), again.len());
        assert_eq!((&twice.cameras, &twice.positions), (&once.cameras, &once.positions));
        assert_eq!((&twice.opacities, &twice.sh_degrees), (&once.opacities, &once.sh_degrees));
        let is_kept = |&i: &usize| {
            let of = |asset: &SplatAsset| (asset.rotations[i], asset.scales[i], asset.maps[i]);
            // Means of maps are taken away and added in f32.
            of(&twice) == of(&once) && off(twice.sh_of(i), once.sh_of(i)) < 1e-5
        };
        // Round splats may be turned by a quarter, since their axes were rounded to the same length (needed 2); a colour
        // may be clamped.
        let changed = 3000 - (0..3000).filter(is_kept).count();
        assert!(changed < 10, "{quality:?}: {changed}");
        let coarser = read(&encode(&once, &options(other)).unwrap()).unwrap().asset;
        assert_ne!(coarser.positions, once.positions, "negative control");
    }
}

fn with(exponents: &[i8]) -> PerSplat<'_> {
    PerSplat { exponents, ..PerSplat::default() }
}

#[test]
fn splats_may_have_individual_exponents() {
    let asset = awkward(200, 2);
    let exponents: Vec<i8> = (0..200).map(|i| (i % 17 - 8) as i8).collect();
    let plain = encode(&asset, &options(Quality::Balanced)).unwrap();
    let per_splat = with(&exponents);
    let bytes = encode(&asset, &LtgsOptions { per_splat, ..options(Quality::Balanced) }).unwrap();
    let contents = read(&bytes).unwrap();
    contents.asset.validate().unwrap();
    assert_eq!(contents.hash, Some(contents.asset.hash()));
    assert_ne!(bytes, plain);
    assert!(is_same(&contents.asset, &quantised(&asset, &Steps::balanced(), per_splat).unwrap()));
    // Missing exponents are zero, too large ones are clamped.
    let short = quantised(&asset, &Steps::balanced(), with(&[100, 0])).unwrap();
    let mut long = vec![0; 200];
    long[0] = 8;
    assert!(is_same(&short, &quantised(&asset, &Steps::balanced(), with(&long)).unwrap()));
    assert!(!is_same(&short, &quantised(&asset, &Steps::balanced(), PerSplat::default()).unwrap()));
}

/// Largest errors of a rounded asset: positions over the geometric mean of the standard deviations, log2 of standard deviations,
/// log2 of opacities, normals, texels.
fn errors(asset: &SplatAsset, read: &SplatAsset) -> [f64; 5] {
    let asset = &super::orient::oriented(asset);
    let mut worst = [0.0_f64; 5];
    // Opacities are distinct enough to find the partner by everything at once.
    for i in 0..read.num_splats() {
        let distance = |j: &usize| -> f64 {
            (0..3).map(|c| f64::from(asset.positions[*j][c] - read.positions[i][c]).powi(2)).sum()
        };
        let j = (0..asset.num_splats()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        let [scale_u, scale_v] = asset.scales[j].map(f64::from);
        worst[0] = worst[0].max(distance(&j).sqrt() / (scale_u * scale_v).sqrt());
        for axis in 0..2 {
            let ratio = f64::from(read.scales[i][axis] / asset.scales[j][axis]);
            worst[1] = worst[1].max(ratio.log2().abs());
        }
        worst[2] = worst[2].max(f64::from(read.opacities[i] / asset.opacities[j]).log2().abs());
        let normal = |q: [f32; 4]| crate::math::quaternion::turned(q.map(f64::from), [0.0, 0.0, 1.0]);
        let (a, b) = (normal(asset.rotations[j]), normal(read.rotations[i]));
        worst[3] = worst[3].max((0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>().sqrt());
        for (a, b) in asset.texels_of(j).iter().zip(read.texels_of(i)) {
            worst[4] = worst[4].max(f64::from(a - b).abs());
        }
    }
    worst
}

#[test]
fn rounding_errors_stay_within_the_steps() {
    let asset = awkward(400, 1);
    let steps = Steps::balanced();
    let [position, scale, opacity, normal, texel] =
        errors(&asset, &quantised(&asset, &steps, PerSplat::default()).unwrap());
    // Half a step in three axes; the finest splats have the step of larger ones (needed 1.03).
    assert!(position <= 0.5 * 3.0_f64.sqrt() * steps.position * 1.1, "{position}");
    assert!(scale <= 0.5 * steps.log2_scale * 1.001, "{scale}");
    assert!(opacity <= 0.5 * steps.log2_opacity * 1.001, "{opacity}");
    // Half a step in two axes; a normal moves by at most 2 sqrt(2) times as much as its swing (needed 1.67).
    assert!(normal <= 2.0 * steps.tilt, "{normal}");
    // 0.6 of a step, luma and two chroma together, 16 times that at the rim at most.
    assert!(texel <= 0.6 * steps.texel * (1.0 + steps.chroma) * 16.0, "{texel}");
    // Negative control: coarser steps make larger errors.
    let coarse = errors(&asset, &quantised(&asset, &steps.scaled(8.0), PerSplat::default()).unwrap());
    assert!(coarse[0] > 4.0 * position && coarse[1] > 4.0 * scale && coarse[2] > 4.0 * opacity, "{coarse:?}");
    assert!(coarse[3] > 4.0 * normal, "{coarse:?}");
    // Those of texels at the rim are clamped.
    let fine = errors(&asset, &quantised(&asset, &steps.scaled(0.125), PerSplat::default()).unwrap());
    assert!(4.0 * fine[4] < texel, "{fine:?}");
}

#[test]
fn single_chunks_can_be_read() {
    for quality in Quality::ALL {
        let asset = awkward(9000, 0);
        let bytes = encode(&asset, &options(quality)).unwrap();
        let whole = read(&bytes).unwrap().asset;
        let reader = Reader::open(&bytes, Path::new(PATH), &limits()).unwrap();
        assert_eq!((reader.num_splats(), reader.quality()), (9000, quality));
        let splats = reader.splats(1).unwrap();
        let second = reader.chunk(1).unwrap();
        assert_eq!(second.positions, whole.positions[splats.clone()]);
        assert_eq!(second.texels_of(17), whole.texels_of(splats.start + 17));
        let [low, high] = reader.bounds(1).unwrap();
        assert!(second.positions.iter().all(|p| (0..3).all(|i| low[i] <= p[i] && p[i] <= high[i])));
        let chunks = reader.num_chunks();
        assert!(reader.chunk(chunks).is_err() && reader.bounds(chunks).is_none());
        assert!(reader.splats(chunks).is_none() && reader.layer(chunks).is_none());
        // Damage to other chunks does not matter.
        let mut damaged = bytes.clone();
        *damaged.last_mut().unwrap() ^= 1;
        let reader = Reader::open(&damaged, Path::new(PATH), &limits()).unwrap();
        assert_eq!(reader.chunk(1).unwrap(), second);
        assert!(matches!(reader.chunk(chunks - 1), Err(Error::Invalid { .. })));
        let issues = validate(&damaged, Path::new(PATH));
        assert_eq!(issues.iter().map(|i| i.code).collect::<Vec<_>>(), ["LT3004"]);
    }
}

/// Corrects the checksums of header and tables, so that the checks behind them are tested.
fn resealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let number = |b: &[u8], at: usize| u32::from_le_bytes(b[at..at + 4].try_into().unwrap()) as usize;
    let tables = 64 + number(&bytes, 28) + 112 * number(&bytes, 36);
    if tables <= bytes.len() {
        let checksum = twox_hash::XxHash3_64::oneshot(&bytes[64..tables]);
        bytes[48..56].copy_from_slice(&checksum.to_le_bytes());
    }
    let checksum = twox_hash::XxHash3_64::oneshot(&bytes[..56]);
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    bytes
}

#[test]
fn hostile_headers_and_tables_are_refused() {
    let bytes = encode(&awkward(5000, 0), &options(Quality::Balanced)).unwrap();
    let tables = 64 + u32::from_le_bytes(bytes[28..32].try_into().unwrap()) as usize;
    let with = |at: usize, new: &[u8]| {
        let mut changed = bytes.clone();
        changed[at..at + new.len()].copy_from_slice(new);
        read(&resealed(changed))
    };
    assert!(with(0, b"LTGS").is_ok(), "control: correct checksums change nothing");
    assert!(matches!(with(0, b"LTGX"), Err(Error::Invalid { .. })));
    assert!(matches!(with(4, &[2, 0]), Err(Error::Unsupported { .. })));
    assert!(matches!(with(8, &[1, 0]), Err(Error::Unsupported { .. })), "unknown feature");
    assert!(matches!(with(25, &[4]), Err(Error::Unsupported { .. })), "unknown profile");
    let newer = with(6, &[9, 0]).unwrap();
    assert_eq!((newer.format.as_str(), newer.warnings.len()), ("ltgs 3.9", 1));
    for (at, new) in [
        (12, vec![0xff; 4]),                                // splats
        (12, 4999_u32.to_le_bytes().to_vec()),              // splats that no chunk has
        (16, vec![0xff; 8]),                                // texels
        (16, 7_u64.to_le_bytes().to_vec()),                 // texels that the chunks do not have
        (24, vec![4]),                                      // SH degree
        (24, vec![3]),                                      // SH degree that the streams do not have
        (25, vec![0]),                                      // lossless with steps
        (28, vec![0xff; 4]),                                // length of metadata
        (32, vec![0xff; 4]),                                // length of their text
        (36, vec![0xff; 4]),                                // chunks
        (40, vec![0xff; 8]),                                // length of the file
        (tables, vec![0xff; 8]),                            // offset beyond everything
        (tables, vec![0; 8]),                               // offset before everything
        (tables + 112, bytes[tables..tables + 8].to_vec()), // the second chunk overlaps the first
        (tables + 8, vec![0xff; 8]),                        // length
        (tables + 72, vec![0xff; 8]),                       // texels of a chunk
        (tables + 80, vec![0; 4]),                          // splats of a chunk
        (tables + 84, vec![1, 0, 0, 0]),                    // a first layer that is not 0
    ] {
        let error = with(at, &new).unwrap_err().to_string();
        assert!(error.starts_with(PATH), "{at}: {error}");
    }
    let small = ReadLimits { decoded_bytes: 1000, layers: None };
    assert!(matches!(decode(&bytes, Path::new(PATH), &small), Err(Error::TooLarge { .. })));
    for bytes in [&b""[..], b"LTGS", &[0; 64]] {
        assert_eq!(validate(bytes, Path::new(PATH))[0].code, "LT3001");
    }
}

#[test]
fn truncated_files_are_errors_and_never_panic() {
    for quality in Quality::ALL {
        let bytes = encode(&awkward(60, 1), &options(quality)).unwrap();
        for percent in 0..100 {
            let cut = &bytes[..bytes.len() * percent / 100];
            assert!(read(cut).is_err(), "{percent} %");
        }
    }
}

#[test]
fn no_damage_makes_the_reader_panic() {
    let mut random = random(1);
    let (mut refused, mut accepted) = (0, 0);
    for quality in Quality::ALL {
        let bytes = encode(&awkward(40, 1), &options(quality)).unwrap();
        let tables = 64 + u32::from_le_bytes(bytes[28..32].try_into().unwrap()) as usize;
        for round in 0..3000 {
            let mut damaged = damaged(&bytes, 0..bytes.len(), &mut random);
            if round % 3 > 0 {
                // Checksums of the blocks and of the tables fit again: the streams themselves must hold.
                for block in [tables, tables + 24, tables + 48] {
                    let number =
                        |at: usize| u64::from_le_bytes(damaged[at..at + 8].try_into().unwrap()) as usize;
                    let (from, length) = (number(block), number(block + 8));
                    let part = damaged.get(from..from.saturating_add(length)).unwrap_or_default();
                    let checksum = twox_hash::XxHash3_64::oneshot(part);
                    damaged[block + 16..block + 24].copy_from_slice(&checksum.to_le_bytes());
                }
                damaged = resealed(damaged);
            }
            match read(&damaged) {
                Err(_) => refused += 1,
                Ok(contents) => {
                    contents.asset.validate().unwrap();
                    accepted += 1;
                }
            }
        }
    }
    // Some damage cannot be noticed: stored bits of positions and bytes of numbers may be anything.
    assert!(refused > 3000 && accepted > 100, "{refused} {accepted}");
}

#[test]
fn unusable_steps_and_assets_are_refused() {
    let asset = awkward(5, 0);
    for steps in [Steps { texel: 0.0, ..Steps::balanced() }, Steps::balanced().scaled(f64::NAN)] {
        let options = LtgsOptions { quality: Quality::Tiny, steps: Some(steps), ..LtgsOptions::default() };
        assert!(matches!(encode(&asset, &options), Err(Error::Invalid { .. })));
        assert!(quantised(&asset, &steps, PerSplat::default()).is_err());
    }
    let mut broken = asset;
    broken.opacities[0] = 0.0;
    assert!(encode(&broken, &options(Quality::Lossless)).is_err());
    // Extremes of valid assets stay valid.
    let mut extreme = awkward(30, 0);
    extreme.positions[0] = [f32::MAX, f32::MIN, 0.0];
    extreme.scales[1] = [1e-44, 1e6];
    extreme.opacities[2] = 1e-44;
    extreme.maps[3].texel_sizes = [f32::MAX, 1e-44];
    extreme.maps[6].texel_sizes = [1e-44; 2];
    extreme.maps[9].shift = [i16::MIN, i16::MAX];
    for factor in [0.01, 1.0, 50.0] {
        let steps = Steps::tiny().scaled(factor);
        let options = LtgsOptions { quality: Quality::Tiny, steps: Some(steps), ..LtgsOptions::default() };
        let read = read(&encode(&extreme, &options).unwrap()).unwrap().asset;
        assert!(is_same(&read, &quantised(&extreme, &steps, PerSplat::default()).unwrap()));
    }
}
