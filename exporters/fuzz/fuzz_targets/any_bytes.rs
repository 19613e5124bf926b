//! Any bytes for every reader. A new format adds its decoder here.
#![no_main]

use libfuzzer_sys::fuzz_target;
use litetex_exporters::{ReadLimits, ltgs, ply};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let (path, limits) = (Path::new("fuzz"), ReadLimits { decoded_bytes: 16 << 20 });
    if let Ok(contents) = ltgs::decode(data, path, &limits) {
        contents.asset.validate().expect("what is accepted is valid");
    }
    if let Ok(contents) = ply::decode_ply(data, path) {
        contents.asset.validate().expect("what is accepted is valid");
    }
    ltgs::validate(data, path);
});
