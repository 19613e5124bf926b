//! Files with a small scene that is shown first.

use super::super::header::{HEADER_BYTES, Header};
use super::super::tables::FileMeta;
use super::*;
use twox_hash::XxHash3_64;

/// A file of 4,100 splats in one layer, and its stand-in.
fn with_stand_in(quality: Quality) -> (SplatAsset, Vec<u8>, Vec<u8>) {
    let asset = awkward(4100, 1);
    let small = encode(&fixture(20, 0), &options(Quality::Custom)).unwrap();
    let stand_in = Some(StandIn { file: &small, until_bytes: 1234 });
    let bytes = encode(&asset, &LtgsOptions { stand_in, ..options(quality) }).unwrap();
    (asset, bytes, small)
}

#[test]
fn a_stand_in_changes_nothing_else_of_a_file() {
    for quality in [Quality::Lossless, Quality::Balanced] {
        let (asset, bytes, small) = with_stand_in(quality);
        let plain = encode(&asset, &options(quality)).unwrap();
        let (found, expected) = (read(&bytes).unwrap(), read(&plain).unwrap());
        assert!(is_same(&found.asset, &expected.asset));
        assert_eq!((found.hash, found.layers), (expected.hash, expected.layers));
        let size = found.stand_in.unwrap();
        assert_eq!(size, StandInSize { bytes: small.len() as u64, splats: Some(20), until_bytes: 1234 });
        assert_eq!(expected.stand_in, None);
        assert_eq!(found.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        assert!(found.sections.iter().any(|s| s.name == "stand_in" && s.bytes == size.bytes));
        // Needed 46: the entry of the metadata.
        assert!(bytes.len() - plain.len() - small.len() < 60, "{} {}", bytes.len(), plain.len());
        assert!(validate(&bytes, Path::new(PATH)).is_empty());
    }
}

#[test]
fn without_layers_the_stand_in_is_read_with_the_metadata_of_the_file() {
    let (asset, bytes, small) = with_stand_in(Quality::Tiny);
    let none = ReadLimits { layers: Some(0), ..limits() };
    let expected = read(&small).unwrap().asset;
    let reader = Reader::open(&bytes, Path::new(PATH), &none).unwrap();
    let end = reader.blocks_start() + small.len();
    // All that follows may be missing.
    for bytes in [&bytes[..], &bytes[..end]] {
        let found = decode(bytes, Path::new(PATH), &none).unwrap().asset;
        assert_eq!((&found.positions, &found.sh), (&expected.positions, &expected.sh));
        assert_eq!((found.near, found.background), (asset.near, asset.background));
        assert_eq!((found.cameras.len(), expected.cameras.len()), (asset.cameras.len(), 0));
    }
    let truncated = decode(&bytes[..end - 1], Path::new(PATH), &none).unwrap_err();
    assert!(truncated.to_string().contains("stand-in"), "{truncated}");
    // A file without one has no splats then.
    let plain = encode(&asset, &options(Quality::Tiny)).unwrap();
    assert_eq!(decode(&plain, Path::new(PATH), &none).unwrap().asset.num_splats(), 0);
}

#[test]
fn damaged_stand_ins_are_refused() {
    let (asset, bytes, small) = with_stand_in(Quality::Balanced);
    let start = Reader::open(&bytes, Path::new(PATH), &limits()).unwrap().blocks_start();
    let mut flipped = bytes.clone();
    flipped[start + 70] ^= 1;
    // The scene does not depend on it.
    let found = read(&flipped).unwrap();
    assert!(is_same(&found.asset, &read(&bytes).unwrap().asset));
    assert_eq!(found.stand_in.unwrap().splats, None);
    let issues = validate(&flipped, Path::new(PATH));
    assert_eq!(issues.iter().map(|i| i.code).collect::<Vec<_>>(), ["LT3009"]);
    // Wrong in itself, with the right checksum; one within another.
    let refused = |file: &[u8]| {
        let stand_in = Some(StandIn { file, until_bytes: 0 });
        let bytes = encode(&asset, &LtgsOptions { stand_in, ..options(Quality::Balanced) }).unwrap();
        assert_eq!(read(&bytes).unwrap().asset.num_splats(), 4100);
        let none = ReadLimits { layers: Some(0), ..limits() };
        decode(&bytes, Path::new(PATH), &none).unwrap_err().to_string()
    };
    let mut other = small.clone();
    other[0] = b'X';
    for file in [&other[..], &small[..small.len() - 1], b""] {
        let message = refused(file);
        assert!(message.contains("stand-in"), "{message}");
    }
    assert!(refused(&bytes).contains("it has a stand-in of its own"));
    let empty = encode(&fixture(0, 0), &options(Quality::Custom)).unwrap();
    assert!(refused(&empty).contains("it has no splats"));
    // More bytes than the file has.
    let mut meta = Reader::open(&bytes, Path::new(PATH), &limits()).unwrap().meta;
    meta.stand_in.as_mut().unwrap().bytes = bytes.len() as u64;
    let message = read(&with_meta(&bytes, &meta)).unwrap_err().to_string();
    assert!(message.contains("stand-in") && message.contains("the file has"), "{message}");
}

/// The file with other metadata, whose blocks stay at their offsets; they must not be longer.
fn with_meta(bytes: &[u8], meta: &FileMeta) -> Vec<u8> {
    let (coded, text_bytes) = meta.encode().unwrap();
    let header = Reader::open(bytes, Path::new(PATH), &limits()).unwrap().header;
    let entries = HEADER_BYTES + header.meta_bytes as usize..HEADER_BYTES + header.tables_bytes();
    let tables = [&coded[..], &bytes[entries.clone()]].concat();
    let header = Header {
        meta_bytes: coded.len() as u32,
        meta_text_bytes: text_bytes as u32,
        file_bytes: (HEADER_BYTES + tables.len() + bytes.len() - entries.end) as u64,
        tables_checksum: XxHash3_64::oneshot(&tables),
        ..header
    };
    [&header.encode()[..], &tables, &bytes[entries.end..]].concat()
}
