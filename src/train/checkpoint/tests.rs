//! Checkpoints survive a round trip bit for bit, and damaged ones are refused.

use super::*;
use crate::backend::WindowStatistics;
use crate::camera::Similarity;
use crate::frequency::SplatBudget;
use crate::model::{AdamState, Model, SplatArrays, SplatGroup, TextureMap, TexturePool};
use crate::rounding::{LastRounding, Offsets, Quantisation};
use crate::train::Pruned;
use crate::train::density::{Budget, Growth, SplatHistory};
use crate::train::{CurvePoint, DeviceBound, Exposures, SizeFigures, TrainHistory};
use glam::DVec3;
use litetex_exporters::ltgs::Steps;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use std::path::PathBuf;

/// A small state with numbers that are easily lost: negative zero, denormals, odd bit patterns.
fn sample(n: usize, sh_degree: u32) -> TrainState {
    let mut bits = 0x1234_5678_u32;
    let mut next = || {
        bits = bits.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        match bits >> 28 {
            0 => -0.0,
            1 => f32::from_bits(bits & 0x7f_ffff),
            _ => (bits as f32 / u32::MAX as f32 - 0.5) * 3.0,
        }
    };
    let mut fill = |arrays: &mut SplatArrays| {
        for group in SplatGroup::ALL {
            arrays.group_mut(group).fill_with(&mut next);
        }
    };
    let mut model = Model {
        splats: SplatArrays::zeros(n, sh_degree),
        textures: TexturePool::neutral((0..n).map(|i| match i % 3 {
            0 => TextureMap::default(),
            k => TextureMap {
                shift: [i as i16, -3],
                ..TextureMap::centred(2 + k as u16, 2, [0.01 * (i + 1) as f32, 0.3])
            },
        }))
        .unwrap(),
        near: 0.039_999_9,
        filter: crate::model::Filter::Ewa,
        capture_from_local: Similarity { scale: 1.0 / 3.0, translation: DVec3::new(-0.1, 1e300, -0.0) },
    };
    let mut adam = AdamState::zeros(&model);
    fill(&mut model.splats);
    fill(&mut adam.splats_m);
    fill(&mut adam.splats_v);
    let mut offsets = Offsets::zeros(&model);
    fill(&mut offsets.splats);
    model.textures.texels.fill_with(&mut next);
    adam.texels_m.fill_with(&mut next);
    adam.texels_v.fill_with(&mut next);
    adam.last_step = (0..n as u32).map(|i| i % 8).collect();
    offsets.texels.fill_with(&mut next);
    offsets.texel_sizes.fill_with(&mut next);
    let steps = Quantisation {
        base: Steps { sh_rest: [0.1, 0.2, 0.3], ..Steps::balanced() },
        factor_log2: 1.375,
        exponents: (0..n).map(|i| i as i8 - 3).collect(),
        contributions: (0..n).map(|i| i as f32 / 7.0).collect(),
    };
    TrainState {
        step: 7,
        model,
        adam,
        epoch_order: vec![3, 0, 2, 1],
        epoch_used: 3,
        epochs: 2,
        histories: (0..n as u16)
            .map(|i| SplatHistory {
                ceiling: 2 << (i % 3),
                prune_count: i,
                checks: 3 * i,
                band_checks: 7 * i,
                bands_settled: i % 3 == 1,
            })
            .collect(),
        window_views: vec![1, 3],
        window: WindowStatistics {
            views: 2,
            seen: (0..n as u32).collect(),
            area: vec![0.25; n],
            contribution: vec![0.125; n],
            error: vec![1e-3; n],
        },
        stage_step: 5,
        revised_step: 6,
        exposures: exposures(),
        pace: SplatBudget { initial: n, momentum: 12.5 },
        growth: Growth { before: Some((0.125, 900)), idle_windows: 1, ended_step: 6 },
        device: DeviceBound {
            budget: Budget { max_splats: Some(n), max_texels: None, max_params: Some(900) },
            ended_step: 5,
            least_scale: 1.25,
            pairs: 1 << 33,
            visible: 1 << 21,
        },
        view_losses: vec![0.5, 0.0, 0.25, 0.125],
        rounded: Some(LastRounding { steps, step: 6, is_last: true, offsets }),
        history: history(n),
    }
}

fn exposures() -> Exposures {
    let mut exposures = Exposures::new(4);
    exposures.maps[2].0[1] = [0.5, 0.75, -0.25, 0.125];
    exposures.sums[3].add([0.1, 0.2, 0.3], [0.4, 0.5, 0.6]);
    exposures
}

fn history(n: usize) -> TrainHistory {
    TrainHistory {
        train_wall_secs: 0.25,
        density_control_wall_secs: 0.125,
        prune_wall_secs: 0.03125,
        rounding_wall_secs: 0.015_625,
        analysis_wall_secs: 0.0625,
        train_cpu_secs: 0.5,
        total_wall_secs: 0.75,
        curve: vec![CurvePoint {
            step: 5,
            wall_secs: 0.1,
            cpu_secs: 0.7,
            psnr_test: 100.0,
            grad_psnr_test: 31.5,
            size: SizeFigures { splats: n, texels: 12, params: 59 * n + 36 },
        }],
        pruned: vec![Pruned { step: 4, params: 100, measured_db: 0.5, ..Pruned::default() }],
    }
}

fn strings() -> BTreeMap<String, String> {
    BTreeMap::from([
        ("config".to_owned(), "steps = 7\n".to_owned()),
        ("scene".to_owned(), "füchse \"1\"".to_owned()),
    ])
}

fn saved(state: &TrainState) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.safetensors");
    save(&path, state, &state.history, &strings()).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    std::fs::read(&path).unwrap()
}

fn load_from(bytes: &[u8]) -> Result<(TrainState, BTreeMap<String, String>)> {
    load_bytes(&PathBuf::from("x.safetensors"), bytes)
}

/// The file with one tensor replaced, removed or added, by the writer of the safetensors crate.
fn edited(bytes: &[u8], name: &str, replacement: Option<(Dtype, Vec<usize>, Vec<u8>)>) -> Vec<u8> {
    let (_, header) = safetensors::SafeTensors::read_metadata(bytes).unwrap();
    let file = safetensors::SafeTensors::deserialize(bytes).unwrap();
    let mut tensors: BTreeMap<String, TensorView<'_>> = file.tensors().into_iter().collect();
    tensors.remove(name);
    if let Some((dtype, shape, data)) = &replacement {
        let view = TensorView::new(*dtype, shape.clone(), data).unwrap();
        tensors.insert(name.to_owned(), view);
    }
    safetensors::serialize(tensors, header.metadata().clone()).unwrap()
}

#[test]
fn states_survive_a_round_trip_bit_for_bit() {
    for (n, degree) in [(0, 0), (1, 1), (7, 2), (10, 3)] {
        let state = sample(n, degree);
        let bytes = saved(&state);
        let (mut loaded, read_strings) = load_from(&bytes).unwrap();
        assert_eq!(loaded.history, TrainHistory::default());
        loaded.history = state.history.clone();
        // -0 equals 0 here; the second file shows every bit.
        assert_eq!(loaded, state);
        assert_eq!(read_strings, strings());
        assert!(saved(&loaded) == bytes, "{n} splats, degree {degree}");
    }
}

#[test]
fn a_history_may_be_missing_but_not_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("step-000007.safetensors");
    let state = sample(3, 1);
    save(&path, &state, &state.history, &strings()).unwrap();
    assert_eq!(load(&path).unwrap().0, state);
    std::fs::write(history_path(&path), "{\"train_wall_secs\": ").unwrap();
    assert!(load(&path).unwrap_err().to_string().contains("history.json"));
    assert_eq!(load_without_history(&path).unwrap().0.history, TrainHistory::default());
    std::fs::remove_file(history_path(&path)).unwrap();
    assert_eq!(load(&path).unwrap().0.history, TrainHistory::default());
}

#[test]
fn truncated_files_are_refused() {
    let bytes = saved(&sample(4, 1));
    for length in 0..bytes.len() {
        assert!(load_from(&bytes[..length]).is_err(), "length {length}");
    }
    let mut longer = bytes;
    longer.push(0);
    assert!(load_from(&longer).is_err());
}

#[test]
fn flipped_bits_are_refused() {
    let state = sample(4, 1);
    let bytes = saved(&state);
    for at in 0..bytes.len() {
        for bit in [0, 3, 7] {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            if let Ok((loaded, _)) = load_from(&damaged) {
                // Spaces that pad the header carry no information.
                assert!(bytes[at] == b' ' && loaded == state, "byte {at}, bit {bit}");
            }
        }
    }
}

#[test]
fn headers_with_absurd_sizes_are_refused_without_allocating() {
    for text in [
        r#"{"splats.sh":{"dtype":"F32","shape":[4294967295,16,3],"data_offsets":[0,824633720640]}}"#,
        r#"{"splats.sh":{"dtype":"F32","shape":[18446744073709551615,16,3],"data_offsets":[0,0]}}"#,
        r#"{"__metadata__":{"litetex":"{}"}}"#,
        "{}",
        "",
    ] {
        let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
        bytes.extend(text.as_bytes());
        assert!(load_from(&bytes).is_err(), "{text}");
    }
    assert!(load_from(&[0xff; 64]).is_err());
}

#[test]
fn errors_name_the_tensor_what_was_found_and_what_was_expected() {
    let bytes = saved(&sample(4, 1));
    let message = |bytes: Vec<u8>| load_from(&bytes).unwrap_err().to_string();
    assert_eq!(
        message(edited(&bytes, "splats.positions", None)),
        "x.safetensors: tensor \"splats.positions\" is missing"
    );
    assert_eq!(
        message(edited(&bytes, "adam.v.log_scales", Some((Dtype::F32, vec![2, 4], vec![0; 32])))),
        "x.safetensors: tensor \"adam.v.log_scales\": found F32 [2, 4], expected F32 [4, 2]"
    );
    assert_eq!(
        message(edited(&bytes, "adam.last_step", Some((Dtype::F32, vec![4], vec![0; 16])))),
        "x.safetensors: tensor \"adam.last_step\": found F32 [4], expected U32 [4]"
    );
    assert_eq!(
        message(edited(&bytes, "splats.sh", Some((Dtype::F32, vec![15, 3], vec![0; 180])))),
        "x.safetensors: tensor \"splats.sh\": found shape [15, 3], expected [16, 3] for the splats' degrees"
    );
    assert_eq!(
        message(edited(&bytes, "extra", Some((Dtype::U8, vec![1], vec![0])))),
        "x.safetensors: tensor \"extra\" is not part of \"litetex-checkpoint/16\""
    );
    let same_shape = Some((Dtype::F32, vec![4, 3], vec![0; 48]));
    assert!(message(edited(&bytes, "splats.positions", same_shape)).contains("checksum"));
}

#[test]
fn values_that_contradict_each_other_are_refused() {
    let refused = |change: fn(&mut TrainState), part: &str| {
        let mut state = TrainState { rounded: None, ..sample(4, 1) };
        change(&mut state);
        let message = load_from(&saved(&state)).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    };
    refused(|s| s.model.near = f32::NAN, "frame.near");
    refused(|s| s.model.capture_from_local.scale = 0.0, "capture_from_local");
    refused(|s| s.model.textures.maps[2].offset_texels = 1, "texture map 2");
    refused(|s| s.model.textures.maps[1].texel_sizes[1] = f32::INFINITY, "texture map 1");
    refused(|s| s.model.textures.maps[2].cols = 0, "texture map 2");
    refused(|s| s.model.textures.maps[2].cols = 3, "texture map 3");
    refused(
        |s| {
            for texels in [&mut s.model.textures.texels, &mut s.adam.texels_m, &mut s.adam.texels_v] {
                texels.extend([0.0; 3]);
            }
        },
        "found 15 texels, the maps need 14",
    );
    refused(|s| s.epoch_used = 5, "5 views used of 4");
    refused(|s| s.adam.last_step[0] = 8, "found step 8, expected at most 7");
}

#[test]
fn other_layouts_are_unsupported_not_invalid() {
    let state = sample(1, 0);
    let header = r#"{"format":"litetex-checkpoint/1","version":"9.0.0","strings":{}}"#;
    let metadata = HashMap::from([(METADATA_KEY.to_owned(), header.to_owned())]);
    let bytes = safetensors::serialize(&layout::tensors(&state), Some(metadata)).unwrap();
    let error = load_from(&bytes).unwrap_err();
    assert_eq!(error.exit_code(), 4);
    assert_eq!(
        error.to_string(),
        "x.safetensors: layout \"litetex-checkpoint/1\" (written by litetex 9.0.0), this program reads \
         \"litetex-checkpoint/16\""
    );
}
