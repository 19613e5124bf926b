//! Fuzzes the streams of a `.ltgs` chunk: the input replaces the blocks of a small valid file, with correct checksums. The
//! first byte chooses the profile, the next two where the geometry and the SH end.
#![no_main]

use libfuzzer_sys::fuzz_target;
use litetex_exporters::ltgs::{LtgsOptions, decode, encode};
use litetex_exporters::{AssetMap, Quality, ReadLimits, SplatAsset};
use std::path::Path;
use std::sync::LazyLock;
use twox_hash::XxHash3_64;

static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let num_splats = 5;
    let map = |i: u32| AssetMap {
        offset_texels: 6 * i,
        rows: 2,
        cols: 3,
        texel_sizes: [0.1, [0.1, 0.2][i as usize % 2]],
        shift: [0, i as i16],
    };
    let asset = SplatAsset {
        positions: (0..num_splats).map(|i| [i as f32, 0.5, -1.0]).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; num_splats],
        scales: vec![[0.1, 0.2]; num_splats],
        opacities: vec![0.5; num_splats],
        sh_degree: 1,
        sh_degrees: vec![1; num_splats],
        sh: vec![0.25; 12 * num_splats],
        maps: (0..num_splats as u32).map(map).collect(),
        texels: vec![0.125; 18 * num_splats],
        ..SplatAsset::default()
    };
    let file = |quality| encode(&asset, &LtgsOptions { quality, ..LtgsOptions::default() }).expect("a valid file");
    Quality::ALL.into_iter().map(file).collect()
});

fuzz_target!(|data: &[u8]| {
    let [profile, first_end, second_end, blocks @ ..] = data else { return };
    let file = &FILES[usize::from(*profile) % FILES.len()];
    let number = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| file[at + i])) as usize;
    let table = 64 + number(28);
    let first = table + 112;
    let mut bytes = [&file[..first], blocks].concat();
    let part = |of_255: u8| usize::from(of_255) * blocks.len() / 255;
    let (geometry, sh) = (part(*first_end.min(second_end)), part(*first_end.max(second_end)));
    let parts = [(table, 0, geometry), (table + 24, geometry, sh), (table + 48, sh, blocks.len())];
    for (entry, from, to) in parts {
        let block = [(first + from) as u64, (to - from) as u64, XxHash3_64::oneshot(&blocks[from..to])];
        for (i, number) in block.into_iter().enumerate() {
            bytes[entry + 8 * i..entry + 8 * i + 8].copy_from_slice(&number.to_le_bytes());
        }
    }
    let length = bytes.len() as u64;
    bytes[40..48].copy_from_slice(&length.to_le_bytes());
    let checksum = XxHash3_64::oneshot(&bytes[64..first]);
    bytes[48..56].copy_from_slice(&checksum.to_le_bytes());
    let checksum = XxHash3_64::oneshot(&bytes[..56]);
    bytes[56..64].copy_from_slice(&checksum.to_le_bytes());
    if let Ok(contents) = decode(&bytes, Path::new("fuzz"), &ReadLimits { decoded_bytes: 16 << 20, layers: None }) {
        contents.asset.validate().expect("what is accepted is valid");
    }
});
