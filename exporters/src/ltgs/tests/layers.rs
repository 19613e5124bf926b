//! Layers: a file that is cut off behind one is the first splats of the whole, and tables that break the rules are refused.

use super::super::{LtgsOptions, PerSplat, Reader, Steps, decode, encode, oriented, quantised, rounded};
use super::{PATH, awkward, is_same, limits, options, read, resealed};
use crate::asset::tests::front;
use crate::{Error, Quality, ReadLimits, SplatAsset};
use std::path::Path;

/// Splats of the scene: enough for three layers, of which the last has two chunks.
const SPLATS: usize = 9000;

/// Position and length of an entry of the table of contents, and where in it splats and layer are.
const ENTRY_BYTES: usize = 112;
const SPLATS_AT: usize = 80;
const LAYER_AT: usize = 84;

fn scene() -> (SplatAsset, Vec<f32>) {
    let contributions = (0..SPLATS).map(|i| (i * 7919 % SPLATS) as f32).collect();
    (awkward(SPLATS, 1), contributions)
}

fn layered(asset: &SplatAsset, contributions: &[f32]) -> Vec<u8> {
    let per_splat = PerSplat { contributions, ..PerSplat::default() };
    encode(asset, &LtgsOptions { per_splat, ..options(Quality::Tiny) }).unwrap()
}

/// Where the table of contents begins.
fn tables_of(bytes: &[u8]) -> usize {
    64 + u32::from_le_bytes(bytes[28..32].try_into().unwrap()) as usize
}

fn first_layers(bytes: &[u8], layers: u32) -> crate::Result<crate::Contents> {
    decode(bytes, Path::new(PATH), &ReadLimits { layers: Some(layers), ..limits() })
}

/// Splats and texels of an asset, the first `n` splats of it.
fn first_splats(asset: &SplatAsset, n: usize) -> SplatAsset {
    let mut first = asset.clone();
    first.retain(&(0..asset.num_splats()).map(|splat| splat < n).collect::<Vec<_>>());
    first
}

#[test]
fn a_file_cut_off_behind_a_layer_is_the_first_splats_of_the_whole() {
    let (asset, contributions) = scene();
    let bytes = layered(&asset, &contributions);
    let whole = read(&bytes).unwrap();
    assert_eq!(whole.hash, Some(whole.asset.hash()));
    let reader = Reader::open(&bytes, Path::new(PATH), &limits()).unwrap();
    assert_eq!((reader.num_layers(), reader.num_chunks(), whole.layers.len()), (3, 4, 3));
    let bytes_of = |l: &crate::LayerSize| l.geometry_bytes + l.sh_bytes + l.texel_bytes;
    let all: u64 = whole.layers.iter().map(bytes_of).sum();
    let mut end = bytes.len() - all as usize;
    let mut splats = 0;
    for (layer, size) in whole.layers.iter().enumerate() {
        end += bytes_of(size) as usize;
        splats += size.splats as usize;
        let found = first_layers(&bytes[..end], layer as u32 + 1).unwrap();
        assert!(is_same(&found.asset, &first_splats(&whole.asset, splats)), "layer {layer}");
        assert_eq!(found.layers, whole.layers);
        assert_eq!(found.sections.iter().map(|s| s.bytes).sum::<u64>(), bytes.len() as u64);
        // Negative controls: other splats, a byte less, a layer more, and all layers.
        assert!(!is_same(&found.asset, &first_splats(&whole.asset, splats - 1)));
        assert!(matches!(first_layers(&bytes[..end - 1], layer as u32 + 1), Err(Error::Invalid { .. })));
        if layer < 2 {
            assert_eq!(found.hash, None);
            assert!(matches!(first_layers(&bytes[..end], layer as u32 + 2), Err(Error::Invalid { .. })));
            assert!(matches!(read(&bytes[..end]), Err(Error::Invalid { .. })));
        }
    }
    assert_eq!((end, splats), (bytes.len(), SPLATS));
    assert_eq!(first_layers(&bytes, 9).unwrap(), whole, "no more layers than there are");
    assert!(first_layers(&[&bytes[..], &[0]].concat(), 1).is_err(), "bytes too many");
}

#[test]
fn the_splats_that_contribute_most_come_first() {
    let (asset, contributions) = scene();
    let per_splat = PerSplat { contributions: &contributions, ..PerSplat::default() };
    let whole = read(&layered(&asset, &contributions)).unwrap();
    assert!(is_same(&whole.asset, &quantised(&asset, &Steps::tiny(), per_splat).unwrap()));
    // Negative control: other contributions, other order.
    assert!(!is_same(&whole.asset, &quantised(&asset, &Steps::tiny(), PerSplat::default()).unwrap()));
    let rounded = rounded(&oriented(&asset), &Steps::tiny(), per_splat).unwrap();
    assert!(is_same(&SplatAsset { cameras: asset.cameras.clone(), ..rounded.asset }, &whole.asset));
    let mut places = rounded.order.iter().map(|&splat| contributions[splat as usize]);
    let mut least = f32::INFINITY;
    for size in &whole.layers {
        let layer: Vec<f32> = places.by_ref().take(size.splats as usize).collect();
        assert!(layer.iter().all(|c| *c < least), "{size:?}");
        least = layer.into_iter().fold(least, f32::min);
    }
    let first = whole.layers[0].geometry_bytes + whole.layers[0].sh_bytes + whole.layers[0].texel_bytes;
    let all: u64 = whole.layers.iter().map(|l| l.geometry_bytes + l.sh_bytes + l.texel_bytes).sum();
    let share = first as f64 / all as f64;
    assert!((0.1..0.16).contains(&share), "{share}");
}

#[test]
fn threads_do_not_change_the_bytes() {
    let (asset, contributions) = scene();
    let with_threads = |n: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
        pool.install(|| layered(&asset, &contributions))
    };
    let one = with_threads(1);
    assert_eq!(with_threads(3), one);
    // Negative control.
    assert_ne!(layered(&asset, &[]), one);
}

#[test]
fn small_scenes_and_lossless_files_have_one_layer() {
    let small = read(&layered(&awkward(5000, 0), &[])).unwrap();
    assert_eq!(small.layers.len(), 1);
    let lossless = read(&encode(&scene().0, &options(Quality::Lossless)).unwrap()).unwrap();
    assert_eq!(lossless.layers.len(), 1);
    assert_eq!(lossless.layers[0].splats, SPLATS as u64);
    assert!(read(&layered(&awkward(0, 0), &[])).unwrap().layers.is_empty());
}

#[test]
fn layers_out_of_order_and_short_chunks_within_them_are_refused() {
    let (asset, contributions) = scene();
    let bytes = layered(&asset, &contributions);
    let tables = tables_of(&bytes);
    let message = |bytes: &[u8], changes: &[(usize, usize, u32)]| {
        let mut changed = bytes.to_vec();
        for &(chunk, at, value) in changes {
            let at = tables_of(bytes) + chunk * ENTRY_BYTES + at;
            changed[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        read(&resealed(changed)).map_or_else(|error| error.to_string(), |_| "reads".to_owned())
    };
    let number = |chunk: usize, at: usize| {
        let at = tables + chunk * ENTRY_BYTES + at;
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    };
    assert_eq!([0, 1, 2, 3].map(|chunk| number(chunk, LAYER_AT)), [0, 1, 2, 2]);
    assert_eq!(message(&bytes, &[(0, LAYER_AT, 0)]), "reads", "control: nothing changed");
    let expected = |chunk, text: &str| format!("{PATH}: chunk {chunk}{text}");
    assert_eq!(message(&bytes, &[(0, LAYER_AT, 1)]), expected(0, ": layer 1, expected 0"));
    assert_eq!(message(&bytes, &[(2, LAYER_AT, 4)]), expected(2, ": layer 4, expected 1 or 2"));
    assert_eq!(message(&bytes, &[(3, LAYER_AT, 1)]), expected(3, ": layer 1, expected 2 or 3"));
    let short = number(0, SPLATS_AT);
    let text = format!(" of layer 0: {short} splats, expected 4096 to 4096");
    assert_eq!(message(&bytes, &[(1, LAYER_AT, 0)]), expected(0, &text));
    // A splat moves from a full chunk to the one behind it.
    let moved = [(2, SPLATS_AT, 4095), (3, SPLATS_AT, number(3, SPLATS_AT) + 1)];
    assert_eq!(message(&bytes, &moved), expected(2, " of layer 2: 4095 splats, expected 4096 to 4096"));
    let lossless = encode(&asset, &options(Quality::Lossless)).unwrap();
    assert_eq!(message(&lossless, &[(2, LAYER_AT, 1)]), expected(2, ": layer 1, expected 0"));
}

#[test]
fn blocks_of_another_layer_order_are_refused() {
    let (asset, contributions) = scene();
    let bytes = layered(&asset, &contributions);
    let tables = tables_of(&bytes);
    // The entries of the first two layers change places, but for their layers: blocks would lie out of order.
    let mut changed = bytes.clone();
    let (first, second) = (tables..tables + LAYER_AT, tables + ENTRY_BYTES..tables + ENTRY_BYTES + LAYER_AT);
    changed[first.clone()].copy_from_slice(&bytes[second.clone()]);
    changed[second].copy_from_slice(&bytes[first]);
    let error = read(&resealed(changed)).unwrap_err().to_string();
    assert!(error.contains("bytes come before it"), "{error}");
}

#[test]
fn what_is_large_in_views_contributes_most_where_nothing_was_measured() {
    let mut asset = awkward(SPLATS, 0);
    asset.cameras.clear();
    // Equal splats before the camera, the first half of them near, one behind, and one seen edge-on.
    for splat in 0..SPLATS {
        asset.positions[splat] = [0.0, 0.0, if splat < SPLATS / 2 { 2.0 } else { 8.0 }];
        asset.rotations[splat] = [1.0, 0.0, 0.0, 0.0];
        asset.scales[splat] = [0.1, 0.05];
        asset.opacities[splat] = 0.5;
    }
    asset.positions[0][2] = -2.0;
    asset.rotations[1] = [0.5_f32.sqrt(), 0.5_f32.sqrt(), 0.0, 0.0];
    asset.opacities[SPLATS - 1] = 1.0;
    let layers = |asset: &SplatAsset| super::super::layers::layers(asset, &[0; SPLATS], &[]);
    let by_area = layers(&asset);
    assert_eq!(by_area[2], 0);
    // Without cameras, sizes alone count: only the opaque splat differs.
    assert_eq!(by_area[SPLATS - 1], 0);
    asset.cameras.push(front(100.0));
    let in_view = layers(&asset);
    assert_eq!((in_view[0], in_view[1], in_view[2], in_view[SPLATS - 1]), (2, 2, 0, 2));
}
