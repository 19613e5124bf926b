//! Writer and reader against each other and against damage.

use super::*;
use crate::asset::tests::{camera, damaged, fixture, front, random};
use crate::fallback::baked::Baker;
use crate::{Contents, Error, Filter, Provenance, ReadLimits, SplatAsset};
use std::path::Path;

/// A file of this version with all cameras and SH of 8 bits.
fn encode(asset: &SplatAsset, version: SpzVersion) -> crate::Result<(Vec<u8>, SpzSummary)> {
    encode_spz(asset, &SpzOptions { version, sh_bits: ShBits::MOST, cameras: true })
}

fn decode(bytes: &[u8]) -> crate::Result<Contents> {
    decode_spz(bytes, Path::new("test.spz"), &ReadLimits::default())
}

/// Largest differences of centres, scales (relative), opacities, DC, other SH, in units of the codes' steps.
fn differences(asset: &SplatAsset, read: &SplatAsset, bits: ShBits) -> [f64; 5] {
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
            let step = if k < 3 { 1.0 / 255.0 / COLOUR_SCALE } else { f64::from(bits.step(k / 3)) / 128.0 };
            at(if k < 3 { 3 } else { 4 }, *a, *b, step);
        }
    }
    worst
}

#[test]
fn splats_round_trip_within_half_a_step() {
    let [fine, coarse] = [ShBits::MOST, ShBits { first: 5, rest: 4 }];
    for (degree, version, sh_bits) in [
        (0, SpzVersion::V3, fine),
        (1, SpzVersion::V4, fine),
        (2, SpzVersion::V3, coarse),
        (3, SpzVersion::V3, fine),
        (3, SpzVersion::V4, coarse),
        (0, SpzVersion::V4, fine),
    ] {
        let mut asset = fixture(30, degree);
        asset.capture_from_local.rotation = [0.5, -0.1, 0.7, 0.5];
        asset.filter = if degree == 1 { Filter::Ewa } else { Filter::None };
        let (bytes, summary) = encode_spz(&asset, &SpzOptions { version, sh_bits, cameras: false }).unwrap();
        assert_eq!((summary.bytes, summary.averaged_maps, summary.clamped_scales), (bytes.len(), 20, 0));
        // 19 bits behind the point, splats of a third of a unit and more.
        assert!(summary.spacing.in_sigmas > 0.0 && summary.spacing.in_sigmas < 1e-4, "{:?}", summary.spacing);
        let read = decode(&bytes).unwrap();
        assert_eq!(read.format, format!("SPZ {}", version.number()));
        assert_eq!(read.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        let kept = Provenance { training: Default::default(), ..asset.provenance.clone() };
        assert_eq!((read.asset.provenance.clone(), read.asset.filter), (kept, asset.filter));
        assert!(read.warnings.is_empty(), "{:?}", read.warnings);
        let worst = differences(&asset, &read.asset, sh_bits);
        assert!(worst.iter().all(|w| *w < 0.51), "{version:?} {degree}: {worst:?}"); // needed 0.4997: half a step
        let baker = Baker::new(&asset);
        for (i, found) in read.asset.rotations.iter().enumerate() {
            let q = baker.splat(i).rotation;
            let cosine: f32 = (0..4).map(|k| q[k] * found[k]).sum();
            assert!(cosine.abs() > 0.999_99, "{q:?} {found:?}"); // needed 0.999_998_8
        }
        // Negative controls: a mirrored frame, and steps that are not those of the file.
        let mut mirrored = read.asset.clone();
        mirrored.positions.iter_mut().for_each(|p| p[1] = -p[1]);
        assert!(differences(&asset, &mirrored, sh_bits)[0] > 100.0);
        if sh_bits == coarse {
            assert!(differences(&asset, &read.asset, fine)[4] > 2.0);
        }
    }
}

/// The file as a program wrote it that knew only an older version.
fn older(asset: &SplatAsset, version: u8) -> Vec<u8> {
    use std::io::{Read, Write};
    let newest = encode(asset, SpzVersion::V3).unwrap().0;
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(&newest[..]).read_to_end(&mut bytes).unwrap();
    let n = asset.num_splats();
    let read = decode(&newest).unwrap().asset;
    let rotations = 16 + 16 * n;
    let short: Vec<u8> = read
        .rotations
        .iter()
        .flat_map(|&q| {
            let [w, x, y, z] = crate::math::yup::rotation(q);
            let sign = if w < 0.0 { -1.0 } else { 1.0 };
            [x, y, z].map(|v| (sign * v * 127.5 + 127.5).round() as u8)
        })
        .collect();
    bytes.splice(rotations..rotations + 4 * n, short);
    if version == 1 {
        // 0.5, -2 and 0 for all.
        bytes.splice(16..16 + 9 * n, [0x00, 0x38, 0x00, 0xc0, 0x00, 0x00].repeat(n));
    }
    bytes[4] = version;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&bytes).unwrap();
    // Newer programs append levels of detail.
    encoder.write_all(&[7; 60]).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn files_of_older_versions_are_read() {
    let asset = fixture(20, 2);
    let newest = decode(&encode(&asset, SpzVersion::V3).unwrap().0).unwrap().asset;
    for version in [1, 2] {
        let found = decode(&older(&asset, version)).unwrap();
        assert_eq!(found.format, format!("SPZ {version}"));
        // Nothing of ours is in them.
        assert_eq!((found.asset.provenance, found.asset.cameras.len()), (Provenance::default(), 0));
        assert_eq!((found.asset.scales, &found.asset.sh), (newest.scales.clone(), &newest.sh));
        let cosines = found.asset.rotations.iter().zip(&newest.rotations);
        let worst = cosines.map(|(a, b)| (0..4).map(|k| a[k] * b[k]).sum::<f32>().abs()).fold(1.0, f32::min);
        assert!(worst > 0.9995, "{worst}"); // needed 0.999_87: steps of 1/127.5
        if version == 1 {
            assert!(found.asset.positions.iter().all(|p| *p == [0.5, 2.0, -0.0]));
        } else {
            assert_eq!(found.asset.positions, newest.positions);
        }
    }
    // Negative control: the same bytes under another version are of other sizes.
    assert_ne!(
        decode(&older(&asset, 2)).unwrap().asset.positions,
        decode(&older(&asset, 1)).unwrap().asset.positions
    );
}

/// The file with bytes for SH up to this degree behind each splat's own, as the library of SPZ stores them since it has degree 4.
fn of_degree(asset: &SplatAsset, degree: u8) -> Vec<u8> {
    use std::io::{Read, Write};
    let mut bytes = Vec::new();
    let newest = encode(asset, SpzVersion::V3).unwrap().0;
    flate2::read::GzDecoder::new(&newest[..]).read_to_end(&mut bytes).unwrap();
    let start = 16 + 20 * asset.num_splats();
    let more = crate::num_sh_coefficients(u32::from(degree)) - crate::num_sh_coefficients(asset.sh_degree);
    let rows = bytes[start..].chunks(bytes[start..].len() / asset.num_splats());
    let longer: Vec<u8> = rows.flat_map(|row| [row, &vec![200; 3 * more]].concat()).collect();
    bytes.splice(start.., longer);
    bytes[12] = degree;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn the_fourth_degree_of_other_programs_is_left_out_with_a_warning() {
    let asset = fixture(20, 3);
    let expected = decode(&encode(&asset, SpzVersion::V3).unwrap().0).unwrap();
    let found = decode(&of_degree(&asset, 4)).unwrap();
    assert_eq!((found.asset.sh_degree, &found.asset.sh), (3, &expected.asset.sh));
    assert_eq!(found.asset.positions, expected.asset.positions);
    assert!(matches!(&found.warnings[..], [w] if w.contains("degree 4")), "{:?}", found.warnings);
    assert!(expected.warnings.is_empty(), "negative control");
    assert!(
        validate(&of_degree(&asset, 4), Path::new("")).iter().all(|i| i.severity != crate::Severity::Error)
    );
    let error = decode(&of_degree(&asset, 5)).unwrap_err().to_string();
    assert!(error.contains("SH degree 5; supported: 0 to 4"), "{error}");
}

#[test]
fn more_metadata_than_there_is_room_for_are_refused() {
    let mut asset = fixture(3, 0);
    asset.cameras = vec![crate::AssetCamera { name: "x".repeat(700), ..front(1.0) }; 100];
    let error = encode(&asset, SpzVersion::V3).unwrap_err();
    assert!(matches!(error, Error::TooLarge { .. }) && error.to_string().contains("version 4"), "{error}");
    assert_eq!(decode(&encode(&asset, SpzVersion::V4).unwrap().0).unwrap().asset.cameras.len(), 100);
    // Without cameras the metadata take little.
    let without = encode_spz(&asset, &SpzOptions::default()).unwrap().0;
    let section = decode(&without).unwrap().sections.iter().find(|s| s.name == "metadata").unwrap().bytes;
    assert!(section < 700, "{section} bytes"); // needed 560
}

#[test]
fn damaged_files_and_other_versions_are_reported() {
    let files = [SpzVersion::V3, SpzVersion::V4].map(|v| encode(&fixture(40, 2), v).unwrap().0);
    let mut random = random(5);
    for bytes in &files {
        for cut in 0..100 {
            assert!(decode(&bytes[..bytes.len() * cut / 100]).is_err(), "cut to {cut} %");
        }
    }
    for i in 0..4_000 {
        let bytes = &files[i % 2];
        if let Ok(contents) = decode(&damaged(bytes, 0..bytes.len(), &mut random)) {
            contents.asset.validate().unwrap();
        }
    }
    // The checksum of gzip finds what its streams do not show.
    let mut damaged = files[0].clone();
    let end = damaged.len() - 8;
    damaged[end] ^= 1;
    assert!(matches!(decode(&damaged), Err(Error::Invalid { .. })));
    let bytes = &files[1];
    let with = |at: usize, word: u32| {
        let mut changed = bytes.clone();
        changed[at..at + 4].copy_from_slice(&word.to_le_bytes());
        decode(&changed).unwrap_err()
    };
    assert!(matches!(with(4, 5), Error::Unsupported { .. }));
    assert!(matches!(with(4, 3), Error::Unsupported { .. }), "version 3 without gzip");
    assert!(matches!(with(8, u32::MAX), Error::TooLarge { .. }));
    assert!(matches!(with(8, 1 << 23), Error::TooLarge { .. }), "more splats than there are bytes");
    assert!(matches!(with(16, u32::MAX), Error::Invalid { .. }));
    assert!(matches!(decode(&[0x1f, 0x8b, 8, 0]), Err(Error::Invalid { .. })));
    let small = ReadLimits { decoded_bytes: 100, layers: None };
    assert!(matches!(decode_spz(bytes, Path::new("x"), &small), Err(Error::TooLarge { .. })));
}

#[test]
fn splats_out_of_range_are_refused_or_counted() {
    let mut asset = fixture(4, 0);
    asset.scales[1] = [1e-7, 0.1];
    assert_eq!(encode(&asset, SpzVersion::V3).unwrap().1.clamped_scales, 1);
    asset.capture_from_local.translation[2] = 1e7;
    assert!(encode(&asset, SpzVersion::V3).unwrap_err().to_string().contains("origin"));
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
    asset.cameras.push(crate::AssetCamera { translation: [0.1, 0.2, 4.0], ..camera() });
    let read = decode(&encode(&asset, SpzVersion::V3).unwrap().0).unwrap().asset;
    assert_eq!(read.cameras.len(), 1);
    let back = read.cameras[0].in_frame(&asset.capture_from_local.inverse().after(&read.capture_from_local));
    for (a, b) in back.translation.iter().zip(asset.cameras[0].translation) {
        assert!((a - b).abs() < 1e-14, "{a} {b}"); // needed 9e-17: these have few digits
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
    let (bytes, _) = encode(&fixture(40, 1), SpzVersion::V4).unwrap();
    let codes = |bytes: &[u8]| -> Vec<_> {
        validate(bytes, Path::new("x")).into_iter().map(|i| (i.code, i.severity)).collect()
    };
    assert_eq!(codes(&bytes), []);
    let mut damaged = bytes.clone();
    damaged[40] = b'[';
    assert_eq!(codes(&damaged), [("LT4010", crate::Severity::Warning)]);
    assert_eq!(codes(&bytes[..60])[0].0, "LT4001");
    let mut asset = fixture(40, 1);
    asset.opacities[3] = 0.001;
    asset.positions[7] = [1e4, 0.0, 0.0];
    let found = codes(&encode(&asset, SpzVersion::V3).unwrap().0);
    assert_eq!(found, [("LT4006", crate::Severity::Info), ("LT4007", crate::Severity::Warning)]);
}

/// A file of another program: the streams of one of ours, without its metadata, with these records announced.
fn with_records(asset: &SplatAsset, version: SpzVersion, records: &[u8]) -> Vec<u8> {
    use std::io::{Read, Write};
    let ours = encode(asset, version).unwrap().0;
    let flags = if records.is_empty() { 0 } else { extensions::HAS_EXTENSIONS };
    if version == SpzVersion::V4 {
        let toc = u32::from_le_bytes(ours[16..20].try_into().unwrap()) as usize;
        let mut bytes = ours[..32].to_vec();
        bytes[14] |= flags;
        bytes[16..20].copy_from_slice(&(32 + records.len() as u32).to_le_bytes());
        return [&bytes, records, &ours[toc..]].concat();
    }
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(&ours[..]).read_to_end(&mut bytes).unwrap();
    bytes[14] |= flags;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(&[&bytes, records].concat()).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn splats_in_other_coordinates_are_turned_and_reported() {
    let asset = fixture(30, 3);
    for version in [SpzVersion::V3, SpzVersion::V4] {
        let plain = decode(&with_records(&asset, version, &[])).unwrap();
        assert!(plain.warnings.is_empty(), "{:?}", plain.warnings);
        // x right, y down, z front: half a turn about x from the coordinates of the format.
        let rdf = extensions::tests::coordinates_record(6);
        let turned = decode(&with_records(&asset, version, &rdf)).unwrap();
        assert!(
            turned.warnings.iter().any(|w| w.contains("RDF") && w.contains("turned")),
            "{:?}",
            turned.warnings
        );
        for i in 0..30 {
            let [x, y, z] = plain.asset.positions[i];
            assert_eq!(turned.asset.positions[i], [x, -y, -z]);
            // The asset has y down as RDF has: what its codes say is what it is.
            let codes = plain.asset.sh_of(i).iter().copied();
            let expected: Vec<f32> = crate::math::yup::sh(&codes.collect::<Vec<_>>()).collect();
            let worst =
                expected.iter().zip(turned.asset.sh_of(i)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst < 1e-6, "{worst}"); // needed 1.2e-7
        }
        assert_ne!(turned.asset.sh_of(0), plain.asset.sh_of(0), "negative control");
        // Coordinates that are those of the format change nothing, unknown ones are warned of.
        let rub = decode(&with_records(&asset, version, &extensions::tests::coordinates_record(4))).unwrap();
        assert_eq!((&rub.asset, rub.warnings.len()), (&plain.asset, 0));
        let odd = decode(&with_records(&asset, version, &extensions::tests::coordinates_record(99))).unwrap();
        assert!(odd.asset == plain.asset && odd.warnings[0].contains("99"), "{:?}", odd.warnings);
    }
    let issues = validate(
        &with_records(&asset, SpzVersion::V4, &extensions::tests::coordinates_record(6)),
        Path::new("x"),
    );
    assert_eq!(issues.iter().map(|i| i.code).collect::<Vec<_>>(), ["LT4012"]);
}

#[test]
fn broken_splats_of_version_1_are_left_out() {
    use std::io::{Read, Write};
    let bytes = older(&fixture(20, 0), 1);
    let with_broken = |count: usize| {
        let mut raw = Vec::new();
        flate2::read::GzDecoder::new(&bytes[..]).read_to_end(&mut raw).unwrap();
        // NaN and infinity as x, as floats of 16 bits.
        (0..count).for_each(|i| raw[16 + 6 * (3 + i)..][..2].copy_from_slice(&[i as u8 & 1, 0x7c]));
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&raw).unwrap();
        decode(&encoder.finish().unwrap())
    };
    let read = with_broken(2).unwrap();
    assert_eq!(read.asset.num_splats(), 18);
    assert!(
        read.warnings[0].starts_with("2 of 20 splats are broken and left out: 3, 4; splat 3"),
        "{:?}",
        read.warnings
    );
    assert!(with_broken(3).unwrap_err().to_string().contains("3 of 20 splats are broken, more than 10 %"));
    assert_eq!(with_broken(0).unwrap().asset.num_splats(), 20, "negative control");
}
