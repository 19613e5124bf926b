//! Header, metadata and table of contents of `.ltgs`, with the checksums set right: the input is a whole file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use litetex_exporters::ReadLimits;
use litetex_exporters::ltgs::{decode, validate};
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

fuzz_target!(|data: &[u8]| {
    let mut bytes = data.to_vec();
    if bytes.len() >= 64 {
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i])) as usize;
        let tables = 64 + number(28) + 88 * number(36);
        if let Some(checksum) = bytes.get(64..tables).map(xxh3_64) {
            bytes[48..56].copy_from_slice(&checksum.to_le_bytes());
        }
        let checksum = xxh3_64(&bytes[..56]);
        bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    }
    let limits = ReadLimits { decoded_bytes: 16 << 20 };
    if let Ok(contents) = decode(&bytes, Path::new("fuzz"), &limits) {
        contents.asset.validate().expect("what is accepted is valid");
        validate(&bytes, Path::new("fuzz"));
    }
});
