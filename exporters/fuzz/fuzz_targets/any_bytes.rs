//! Feeds arbitrary bytes to every reader. A new format adds its decoder here.
#![no_main]

use libfuzzer_sys::fuzz_target;
use litetex_exporters::{Contents, ReadLimits, Result, gltf, ltgs, ply, spz, usd};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Readers of USD take files: one set per process, in memory where the system has such a place.
static FILES: LazyLock<[PathBuf; 3]> = LazyLock::new(|| {
    let shared = Path::new("/dev/shm");
    let folder = if shared.is_dir() { shared.to_owned() } else { std::env::temp_dir() };
    ["usda", "usdc", "usdz"].map(|extension| folder.join(format!("litetex-fuzz-{}.{extension}", std::process::id())))
});

fn check(read: Result<Contents>) {
    if let Ok(contents) = read {
        contents.asset.validate().expect("what is accepted is valid");
    }
}

fuzz_target!(|data: &[u8]| {
    let (path, limits) = (Path::new("fuzz"), ReadLimits { decoded_bytes: 16 << 20, layers: None });
    check(ltgs::decode(data, path, &limits));
    check(spz::decode_spz(data, path, &limits));
    check(gltf::decode_glb(data, path, &limits));
    if let Ok(contents) = ply::decode_ply(data, path, &limits) {
        contents.asset.validate().expect("what is accepted is valid");
    }
    ltgs::validate(data, path);
    spz::validate(data, path);
    ply::validate(data, path);
    gltf::validate(data, path);
    for file in FILES.iter() {
        std::fs::write(file, data).expect("written");
        check(usd::read_usd(file, &limits));
        drop(usd::read_fallback(file, &limits));
        usd::validate(file);
    }
});
