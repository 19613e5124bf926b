//! Names, types and shapes of a checkpoint's tensors, with writing and reading side by side.
//!
//! | tensor | type and shape |
//! |---|---|
//! | `splats.{positions,quaternions,log_scales,opacity_logits,sh}` | f32 `[n,3] [n,4] [n,2] [n] [c,3]`, c = sum of the splats'
//! (degree + 1)^2 |
//! | `splats.sh_degrees` | u16 `[n]`: SH degree of each splat |
//! | `adam.m.*`, `adam.v.*` | the same five, and `texels` |
//! | `adam.last_step`, `adam.step`, `adam.rates` | u32 `[n]`, u32 `[1]`, f32 `[9]` |
//! | `textures.maps.{offset,rows,cols,texel_sizes,shift}` | u32, u16, u16 `[n]`, f32, i16 `[n,2]` |
//! | `textures.texels` | f32 `[t,3]` |
//! | `frame.near`, `frame.filter`, `frame.capture_from_local` | f32 `[1]`, u32 `[1]`: 0 none, 1 ewa; f64 `[4]`: scale, translation |
//! | `state.counters`, `state.epoch_order` | u32 `[5]`: step, epochs, views used, step of the stage, last step with a revision;
//! u32 `[views]` |
//! | `state.histories`, `state.pace` | u16 `[n,5]`: map ceiling, prune count, checks, band checks, bands settled; f64 `[2]`:
//! initial splats, momentum |
//! | `state.view_losses` | f32 `[views]`: loss of each view when it was last rendered; 0: not at this size |
//! | `state.growth` | f64 `[4]`: loss and parameters at the end of the window before, 0 if unknown; idle windows; step of the end |
//! | `state.device` | f64 `[6]`: most splats, texels and parameters, -1 without bound; step of the end of growth; least render scale;
//! most pairs of a step |
//! | `exposure.maps`, `exposure.sums` | f32 `[v,3,4]`, f64 `[v,22]`: the sums of the epoch; v = views, or 0 without correction |
//! | `rounded.*` | of a model that is trained as its file will hold it: see `rounded.rs` |
//! | `window.views`, `window.counts`, `window.sums` | u32 `[views]`, u32 `[n + 1]`: views counted, views that saw each; f32 `[3,n]` |

use super::reader::{Reader, f32s, f64s, i16s, u16s, u32s};
use super::rounded;
use super::tensor::{Data, Tensor, arrays, put_arrays};
use crate::Result;
use crate::backend::{ColourMap, ColourSums, NUM_COLOUR_SUMS, WindowStatistics};
use crate::camera::Similarity;
use crate::constants::{SH_DEGREE_MAX, sh_coefficients};
use crate::frequency::SplatBudget;
use crate::model::{AdamState, Filter, LearningRates, Model, TextureMap, TexturePool};
use crate::train::density::{Budget, Growth, SplatHistory};
use crate::train::{DeviceBound, Exposures, TrainHistory, TrainState};
use glam::DVec3;
use safetensors::Dtype;
use std::collections::BTreeMap;

/// Every array of a state.
pub fn tensors(state: &TrainState) -> BTreeMap<String, Tensor<'_>> {
    let mut out = BTreeMap::new();
    let mut put = |name: &str, tensor| drop(out.insert(name.to_owned(), tensor));
    let TrainState { model, adam, .. } = state;
    let n = model.num_splats();
    let texels = [model.textures.texels.len() / 3, 3];
    for (prefix, arrays) in
        [("splats", &model.splats), ("adam.m", &adam.splats_m), ("adam.v", &adam.splats_v)]
    {
        put_arrays(prefix, arrays, &mut put);
    }
    put(
        "splats.sh_degrees",
        Tensor::new(&[n], Data::U16(model.splats.sh_degrees().iter().map(|&d| d.into()).collect())),
    );
    put("adam.m.texels", Tensor::f32(&texels, &adam.texels_m));
    put("adam.v.texels", Tensor::f32(&texels, &adam.texels_v));
    put("adam.last_step", Tensor::u32(&[n], &adam.last_step));
    put("adam.step", Tensor::scalar_u32(adam.step));
    put("adam.rates", Tensor::f32(&[9], adam.rates.to_array().to_vec()));

    let maps = &model.textures.maps;
    let offsets: Vec<u32> = maps.iter().map(|m| m.offset_texels).collect();
    let sizes: Vec<f32> = maps.iter().flat_map(|m| m.texel_sizes).collect();
    let shifts = maps.iter().flat_map(|m| m.shift).collect();
    let u16s = |f: fn(&TextureMap) -> u16| Data::U16(maps.iter().map(f).collect());
    put("textures.maps.offset", Tensor::u32(&[n], offsets));
    put("textures.maps.rows", Tensor::new(&[n], u16s(|m| m.rows)));
    put("textures.maps.cols", Tensor::new(&[n], u16s(|m| m.cols)));
    put("textures.maps.texel_sizes", Tensor::f32(&[n, 2], sizes));
    put("textures.maps.shift", Tensor::new(&[n, 2], Data::I16(shifts)));
    put("textures.texels", Tensor::f32(&texels, &model.textures.texels));

    let frame = model.capture_from_local;
    let frame_numbers = vec![frame.scale, frame.translation.x, frame.translation.y, frame.translation.z];
    put("frame.near", Tensor::f32(&[1], vec![model.near]));
    put("frame.filter", Tensor::scalar_u32(u32::from(model.filter == Filter::Ewa)));
    put("frame.capture_from_local", Tensor::new(&[4], Data::F64(frame_numbers)));
    let TrainState { step, epochs, epoch_used, stage_step, revised_step, .. } = *state;
    let counters = vec![step, epochs, epoch_used, stage_step, revised_step];
    put("state.counters", Tensor::u32(&[5], counters));
    let fields =
        |l: &SplatHistory| [l.ceiling, l.prune_count, l.checks, l.band_checks, l.bands_settled.into()];
    let histories = state.histories.iter().flat_map(fields).collect();
    put("state.histories", Tensor::new(&[state.histories.len(), 5], Data::U16(histories)));
    put("state.view_losses", Tensor::f32(&[state.view_losses.len()], &state.view_losses));
    let Growth { before, idle_windows, ended_step } = state.growth;
    let (loss, params) = before.unwrap_or_default();
    let growth = vec![loss, params as f64, idle_windows.into(), ended_step.into()];
    put("state.growth", Tensor::new(&[4], Data::F64(growth)));
    let DeviceBound { budget, ended_step, least_scale, pairs, visible } = state.device;
    let [splats, texels, params] = [budget.max_splats, budget.max_texels, budget.max_params]
        .map(|most| most.map_or(-1.0, |most| most as f64));
    let device = vec![splats, texels, params, ended_step.into(), least_scale, pairs as f64, visible as f64];
    put("state.device", Tensor::new(&[7], Data::F64(device)));
    put("state.pace", Tensor::new(&[2], Data::F64(vec![state.pace.initial as f64, state.pace.momentum])));
    let exposures = &state.exposures;
    let numbers: Vec<f32> = exposures.maps.iter().flat_map(|map| map.0).flatten().collect();
    put("exposure.maps", Tensor::f32(&[exposures.maps.len(), 3, 4], numbers));
    let numbers = exposures.sums.iter().flat_map(|sums| sums.0).collect();
    put("exposure.sums", Tensor::new(&[exposures.sums.len(), NUM_COLOUR_SUMS], Data::F64(numbers)));
    if let Some(found) = &state.rounded {
        rounded::put(found, &mut put);
    }
    let w = &state.window;
    put("window.views", Tensor::u32(&[state.window_views.len()], &state.window_views));
    let counts: Vec<u32> = [w.views].iter().chain(&w.seen).copied().collect();
    put("window.counts", Tensor::u32(&[counts.len()], counts));
    let sums = [w.area.as_slice(), &w.contribution, &w.error].concat();
    put("window.sums", Tensor::f32(&[3, w.area.len()], sums));
    put("state.epoch_order", Tensor::u32(&[state.epoch_order.len()], &state.epoch_order));
    out
}

/// The state in the tensors. Sizes are checked against each other, values are not.
pub fn state(reader: &mut Reader<'_>) -> Result<TrainState> {
    let n = reader.first_dimension("splats.opacity_logits")?;
    let degrees = sh_degrees(reader, n)?;
    let [splats, splats_m, splats_v] =
        ["splats", "adam.m", "adam.v"].map(|prefix| arrays(reader, prefix, &degrees));
    let (splats, splats_m, splats_v) = (splats?, splats_m?, splats_v?);
    let texels = [reader.first_dimension("textures.texels")?, 3];
    let adam = AdamState {
        splats_m,
        splats_v,
        texels_m: f32s(reader.take("adam.m.texels", Dtype::F32, &texels)?),
        texels_v: f32s(reader.take("adam.v.texels", Dtype::F32, &texels)?),
        last_step: u32s(reader.take("adam.last_step", Dtype::U32, &[n])?),
        step: u32s(reader.take("adam.step", Dtype::U32, &[1])?)[0],
        rates: LearningRates::from_array(&f32s(reader.take("adam.rates", Dtype::F32, &[9])?)),
    };
    let textures = TexturePool {
        maps: maps(reader, n)?,
        texels: f32s(reader.take("textures.texels", Dtype::F32, &texels)?),
    };
    let near = f32s(reader.take("frame.near", Dtype::F32, &[1])?)[0];
    let filter = match u32s(reader.take("frame.filter", Dtype::U32, &[1])?)[0] {
        0 => Filter::None,
        1 => Filter::Ewa,
        other => {
            return Err(reader.invalid(format!("tensor \"frame.filter\": found {other}, expected 0 or 1")));
        }
    };
    let frame = f64s(reader.take("frame.capture_from_local", Dtype::F64, &[4])?);
    let counters = u32s(reader.take("state.counters", Dtype::U32, &[5])?);
    let views = reader.first_dimension("state.epoch_order")?;
    Ok(TrainState {
        step: counters[0],
        model: Model {
            splats,
            textures,
            near,
            filter,
            capture_from_local: Similarity {
                scale: frame[0],
                translation: DVec3::new(frame[1], frame[2], frame[3]),
            },
        },
        adam,
        epoch_order: u32s(reader.take("state.epoch_order", Dtype::U32, &[views])?),
        epoch_used: counters[2],
        epochs: counters[1],
        stage_step: counters[3],
        revised_step: counters[4],
        histories: histories(reader, n)?,
        exposures: exposures(reader)?,
        pace: pace(reader)?,
        growth: growth(reader)?,
        device: device(reader)?,
        view_losses: {
            let views = reader.first_dimension("state.view_losses")?;
            f32s(reader.take("state.view_losses", Dtype::F32, &[views])?)
        },
        rounded: rounded::take(reader, &degrees, texels[0])?,
        window_views: {
            let views = reader.first_dimension("window.views")?;
            u32s(reader.take("window.views", Dtype::U32, &[views])?)
        },
        window: window(reader)?,
        history: TrainHistory::default(),
    })
}

/// Histories of the splats; none in the state of a run that has not begun.
fn histories(reader: &mut Reader<'_>, n: usize) -> Result<Vec<SplatHistory>> {
    let found = reader.first_dimension("state.histories")?;
    if found != n && found != 0 {
        return Err(
            reader.invalid(format!("tensor \"state.histories\": found {found} histories for {n} splats"))
        );
    }
    let values = u16s(reader.take("state.histories", Dtype::U16, &[found, 5])?);
    let history = |v: &[u16]| SplatHistory {
        ceiling: v[0],
        prune_count: v[1],
        checks: v[2],
        band_checks: v[3],
        bands_settled: v[4] != 0,
    };
    Ok(values.chunks_exact(5).map(history).collect())
}

fn growth(reader: &mut Reader<'_>) -> Result<Growth> {
    let values = f64s(reader.take("state.growth", Dtype::F64, &[4])?);
    Ok(Growth {
        before: Some((values[0], values[1] as usize)).filter(|&(loss, _)| loss > 0.0),
        idle_windows: values[2] as u32,
        ended_step: values[3] as u32,
    })
}

fn device(reader: &mut Reader<'_>) -> Result<DeviceBound> {
    let values = f64s(reader.take("state.device", Dtype::F64, &[7])?);
    if !values.iter().all(|v| v.is_finite()) || values[4] < 1.0 {
        return Err(reader.invalid(format!(
            "tensor \"state.device\": found {values:?}, expected finite numbers and a render scale of at least 1"
        )));
    }
    let most = |value: f64| (value >= 0.0).then_some(value as usize);
    Ok(DeviceBound {
        budget: Budget {
            max_splats: most(values[0]),
            max_texels: most(values[1]),
            max_params: most(values[2]),
        },
        ended_step: values[3] as u32,
        least_scale: values[4],
        pairs: values[5] as u64,
        visible: values[6] as u64,
    })
}

fn exposures(reader: &mut Reader<'_>) -> Result<Exposures> {
    let views = reader.first_dimension("exposure.maps")?;
    let maps = f32s(reader.take("exposure.maps", Dtype::F32, &[views, 3, 4])?);
    let sums = f64s(reader.take("exposure.sums", Dtype::F64, &[views, NUM_COLOUR_SUMS])?);
    if !maps.iter().all(|v| v.is_finite()) || !sums.iter().all(|v| v.is_finite()) {
        return Err(reader.invalid("tensors \"exposure.*\": expected finite numbers".to_owned()));
    }
    let map = |m: &[f32]| ColourMap([0, 4, 8].map(|row| [0, 1, 2, 3].map(|k| m[row + k])));
    let (sums, _) = sums.as_chunks();
    Ok(Exposures {
        maps: maps.chunks_exact(12).map(map).collect(),
        sums: sums.iter().copied().map(ColourSums).collect(),
    })
}

fn pace(reader: &mut Reader<'_>) -> Result<SplatBudget> {
    let values = f64s(reader.take("state.pace", Dtype::F64, &[2])?);
    if !values.iter().all(|v| v.is_finite() && *v >= 0.0) {
        return Err(reader
            .invalid(format!("tensor \"state.pace\": found {values:?}, expected numbers of at least 0")));
    }
    Ok(SplatBudget { initial: values[0] as usize, momentum: values[1] })
}

/// Sums of the statistics window, of every splat or of none.
fn window(reader: &mut Reader<'_>) -> Result<WindowStatistics> {
    let entries = reader.first_dimension("window.counts")?;
    let counts = u32s(reader.take("window.counts", Dtype::U32, &[entries])?);
    let Some((&views, seen)) = counts.split_first() else {
        return Err(
            reader.invalid("tensor \"window.counts\": found no number, expected at least 1".to_owned())
        );
    };
    let n = seen.len();
    let sums = f32s(reader.take("window.sums", Dtype::F32, &[3, n])?);
    let column = |k: usize| sums[k * n..(k + 1) * n].to_vec();
    Ok(WindowStatistics {
        views,
        seen: seen.to_vec(),
        area: column(0),
        contribution: column(1),
        error: column(2),
    })
}

fn maps(reader: &mut Reader<'_>, n: usize) -> Result<Vec<TextureMap>> {
    let offsets = u32s(reader.take("textures.maps.offset", Dtype::U32, &[n])?);
    let rows = u16s(reader.take("textures.maps.rows", Dtype::U16, &[n])?);
    let cols = u16s(reader.take("textures.maps.cols", Dtype::U16, &[n])?);
    let sizes = f32s(reader.take("textures.maps.texel_sizes", Dtype::F32, &[n, 2])?);
    let shifts = i16s(reader.take("textures.maps.shift", Dtype::I16, &[n, 2])?);
    let map = |i: usize| TextureMap {
        offset_texels: offsets[i],
        rows: rows[i],
        cols: cols[i],
        texel_sizes: [sizes[2 * i], sizes[2 * i + 1]],
        shift: [shifts[2 * i], shifts[2 * i + 1]],
    };
    Ok((0..n).map(map).collect())
}

/// SH degrees of the splats, whose coefficients the file must have.
fn sh_degrees(reader: &mut Reader<'_>, n: usize) -> Result<Vec<u8>> {
    let found = u16s(reader.take("splats.sh_degrees", Dtype::U16, &[n])?);
    if let Some(other) = found.iter().find(|&&d| u32::from(d) > SH_DEGREE_MAX) {
        return Err(reader.invalid(format!(
            "tensor \"splats.sh_degrees\": found {other}, expected at most {SH_DEGREE_MAX}"
        )));
    }
    let coefficients: usize = found.iter().map(|&d| sh_coefficients(d.into())).sum();
    let shape = reader.shape("splats.sh")?;
    if shape != [coefficients, 3] || 3 * coefficients > u32::MAX as usize {
        return Err(reader.invalid(format!(
            "tensor \"splats.sh\": found shape {shape:?}, expected [{coefficients}, 3] for the splats' degrees"
        )));
    }
    Ok(found.iter().map(|&d| d as u8).collect())
}
