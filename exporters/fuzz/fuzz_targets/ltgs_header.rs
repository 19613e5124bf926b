//! Header, metadata and table of contents of `.ltgs`, with the checksums set right: the input is a whole file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use litetex_exporters::ReadLimits;
use litetex_exporters::ltgs::{decode, validate};
use std::path::Path;
use twox_hash::XxHash3_64;

fuzz_target!(|data: &[u8]| {
    let mut bytes = data.to_vec();
    if bytes.len() >= 64 {
        let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i])) as usize;
        let tables = 64 + number(28) + 112 * number(36);
        if let Some(checksum) = bytes.get(64..tables).map(XxHash3_64::oneshot) {
            bytes[48..56].copy_from_slice(&checksum.to_le_bytes());
        }
        let checksum = XxHash3_64::oneshot(&bytes[..56]);
        bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    }
    let limits = ReadLimits { decoded_bytes: 16 << 20, layers: None };
    if let Ok(contents) = decode(&bytes, Path::new("fuzz"), &limits) {
        contents.asset.validate().expect("what is accepted is valid");
        validate(&bytes, Path::new("fuzz"));
    }
});
