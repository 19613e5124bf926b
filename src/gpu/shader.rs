//! The preprocessor of the shaders: includes, conditional lines, and constants from Rust. It does not touch any
//! device; naga and browsers get plain WGSL.
//!
//! Directives take a line each: `#include common/x` (each file once), `#constants`, `#if FLAG`, `#else`,
//! `#endif`.

use super::kernels::{Groups, NUM_GROUPS};
use crate::constants as c;
use std::fmt::Write as _;

/// Width of a tile, and height unless [`HALF_TILES`] is set.
pub const TILE_PX: u32 = 16;
/// Height of the rasterisation's tiles with the flag [`HALF_TILES`].
pub const HALF_TILE_ROWS_PX: u32 = 8;
/// Largest sum of texel gradients in fixed point; one spare bit absorbs rounding.
pub const FIXED_MAX: f64 = (1 << 30) as f64;
/// Flag that all kernels get on software drivers.
pub const HALF_TILES: &str = "HALF_TILES";
/// Flag that all kernels get where the backward pass is by subgroups: it visits segments of tiles ([`super::segments`]).
pub const SEGMENTS: &str = "SEGMENTS";
/// Numbers of lanes that kernels by subgroups can sum over, and the flags for them.
pub const SUM_LANES: [(u32, &[&str]); 4] =
    [(4, &["LANES_4"]), (8, &["LANES_8"]), (16, &["LANES_16"]), (32, &[])];
/// Invocations of most workgroups: the pixels of a tile.
pub const GROUP: u32 = TILE_PX * TILE_PX;
/// Invocations per workgroup in kernels with one workgroup per splat.
pub const SPLAT_GROUP: u32 = 64;
/// Splats of a batch that the forward rasterisation loads through workgroup memory.
pub const RASTER_BATCH: u32 = 64;
/// Elements per workgroup in the prefix sums and the sort.
pub const BLOCK: u32 = 1024;
/// Bits of a digit of the radix sort.
pub const DIGIT_BITS: u32 = 8;
/// Most blocks of keys whose counts of a digit one lane adds up, instead of a workgroup. Software drivers pay for each workgroup
/// with barriers (measured on SwiftShader, 300 splats: 336 of 579 ms of a step were such sums of a block or two).
pub const LANE_BLOCKS: u32 = 16;
/// Most workgroups along one axis of a dispatch; larger dispatches are folded to two axes.
pub const MAX_GROUPS: u32 = 65_535;
/// Bits of a depth key: the f32 bits of the depth minus those of the near plane; enough for depths up to 2^32
/// times near.
pub const DEPTH_KEY_BITS: u32 = 28;

macro_rules! sources {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_str!(concat!("../../shaders/", $name, ".wgsl")))),*]
    };
}

/// Every shader file: its name below `shaders/` without the extension, and its text.
pub const SOURCES: &[(&str, &str)] = sources![
    "common/adam",
    "common/bounds",
    "common/coarser_map",
    "common/digit_counts",
    "common/exposure",
    "common/filter",
    "common/fixed",
    "common/group_lists",
    "common/groups",
    "common/hit",
    "common/image",
    "common/keep_states",
    "common/keep_windows",
    "common/lane_sums",
    "common/list_group",
    "common/map_change",
    "common/numbers",
    "common/pair_sums",
    "common/photo",
    "common/projected",
    "common/replay",
    "common/scan",
    "common/segments",
    "common/sh",
    "common/sort",
    "common/splat",
    "common/splat_sums",
    "common/status",
    "common/step",
    "common/texel_grad",
    "common/texel_sums",
    "common/texel_window",
    "common/tile",
    "common/tile_pairs",
    "common/tile_sums",
    "common/invisible",
    "common/visits",
    "common/window",
    "adam_texel",
    "edit_splats",
    "exposure_bwd",
    "exposure_fwd",
    "exposure_sums",
    "finish",
    "finish_blocks",
    "gather_pairs",
    "gather_splats",
    "geometry_loss",
    "list_visible",
    "loss_bwd",
    "loss_fwd",
    "prefix_blocks",
    "prefix_sums",
    "prepare_probes",
    "probe_costs",
    "project",
    "project_bwd",
    "raster_bwd",
    "raster_bwd_subgroups",
    "raster_fwd",
    "regrid_maps",
    "resample_maps",
    "flush_splat",
    "flush_texel",
    "sort_scan",
    "sort_scatter",
    "sum_pairs",
    "tile_emit",
    "visible_sums",
];

/// Preprocessed WGSL, ready to be compiled.
#[derive(Clone, Debug)]
pub struct ExpandedShader {
    /// The WGSL source.
    pub text: String,
    /// File and line that each line of `text` comes from.
    lines: Vec<(&'static str, u32)>,
}

impl ExpandedShader {
    /// File and line that a line of `text` (counted from 1) comes from, as `shaders/FILE.wgsl:LINE`.
    pub fn origin(&self, line: u32) -> String {
        let (file, line) = self.lines.get(line.max(1) as usize - 1).copied().unwrap_or(("?", 0));
        format!("shaders/{file}.wgsl:{line}")
    }
}

/// Preprocesses a kernel.
///
/// # Errors
/// File, line and problem, if a directive is invalid or a file is missing.
pub fn expand(kernel: &str, flags: &[&str]) -> Result<ExpandedShader, String> {
    let mut out = ExpandedShader { text: String::new(), lines: Vec::new() };
    let mut included = Vec::new();
    include(kernel, flags, &mut included, &mut out)?;
    Ok(out)
}

fn include(
    name: &str,
    flags: &[&str],
    included: &mut Vec<&'static str>,
    out: &mut ExpandedShader,
) -> Result<(), String> {
    let Some(&(name, source)) = SOURCES.iter().find(|(n, _)| *n == name) else {
        return Err(format!("there is no shader file {name:?}"));
    };
    if included.contains(&name) {
        return Ok(());
    }
    included.push(name);
    // For each open #if, whether its lines are active.
    let mut taken: Vec<bool> = Vec::new();
    for (number, line) in (1..).zip(source.lines()) {
        let wrong = |what: &str| format!("shaders/{name}.wgsl:{number}: {what}: {line:?}");
        let directive = line.trim().strip_prefix('#').map(|d| d.split_once(' ').unwrap_or((d, "")));
        let active = taken.iter().all(|&t| t);
        match directive {
            Some(("if", flag)) => taken.push(flags.contains(&flag)),
            Some(("else", _)) => {
                let last = taken.last_mut().ok_or_else(|| wrong("#else without #if"))?;
                *last = !*last;
            }
            Some(("endif", _)) => {
                taken.pop().ok_or_else(|| wrong("#endif without #if"))?;
            }
            Some(_) if !active => {}
            Some(("include", file)) => include(file, flags, included, out)?,
            Some(("constants", _)) => {
                for constant in constants() {
                    push(out, &constant, name, number);
                }
            }
            Some(_) => return Err(wrong("unknown directive")),
            None if active => push(out, line, name, number),
            None => {}
        }
    }
    if taken.is_empty() { Ok(()) } else { Err(format!("shaders/{name}.wgsl: #if without #endif")) }
}

fn push(out: &mut ExpandedShader, line: &str, file: &'static str, number: u32) {
    out.text.push_str(line);
    out.text.push('\n');
    out.lines.push((file, number));
}

/// Values with their names.
pub type Named<T> = Vec<(&'static str, T)>;

/// Scalar constants shared by Rust and the shaders: floats and integers.
pub fn shared_constants() -> (Named<f64>, Named<u32>) {
    let floats = vec![
        ("ALPHA_MIN", c::ALPHA_MIN),
        ("ALPHA_MAX", c::ALPHA_MAX),
        ("TRANSMITTANCE_MIN", c::TRANSMITTANCE_MIN),
        ("EDGE_ON_MIN", c::EDGE_ON_MIN),
        ("FOOTPRINT_TEXELS_MAX", c::FOOTPRINT_TEXELS_MAX),
        ("DENOMINATOR_MIN", c::DENOMINATOR_MIN),
        ("CONIC_MARGIN", c::CONIC_MARGIN),
        ("SURFACE_ALPHA_MIN", c::SURFACE_ALPHA_MIN),
        ("SSIM_C1", c::SSIM_C1),
        ("SSIM_C2", c::SSIM_C2),
        ("SH_0", c::SH_0),
        ("SH_1", c::SH_1),
        ("ADAM_BETA1", c::ADAM_BETA1),
        ("ADAM_BETA2", c::ADAM_BETA2),
        ("ADAM_EPSILON", c::ADAM_EPSILON),
        ("ADAM_LN_BETA1", c::ADAM_BETA1.ln()),
        ("ADAM_LN_BETA2", c::ADAM_BETA2.ln()),
        ("LOG_SCALE_MIN", c::LOG_SCALE_RANGE.0),
        ("LOG_SCALE_MAX", c::LOG_SCALE_RANGE.1),
        ("BASE_RGB_MAX", c::BASE_RGB_MAX),
        ("PROBED_LOGIT_MAX", c::PROBED_LOGIT_MAX),
        ("PROBED_TEXEL_MAX", c::PROBED_TEXEL_MAX),
        ("FIXED_MAX", FIXED_MAX),
    ];
    let integers = vec![
        ("TILE_PX", TILE_PX),
        ("HALF_TILE_ROWS_PX", HALF_TILE_ROWS_PX),
        ("GROUP", GROUP),
        ("SPLAT_GROUP", SPLAT_GROUP),
        ("RASTER_BATCH", RASTER_BATCH),
        ("BLOCK", BLOCK),
        ("DIGIT_BITS", DIGIT_BITS),
        ("DIGITS", 1 << DIGIT_BITS),
        ("LANE_BLOCKS", LANE_BLOCKS),
        ("DEPTH_KEY_BITS", DEPTH_KEY_BITS),
        ("SSIM_RADIUS_PX", c::SSIM_RADIUS_PX as u32),
        ("MAX_GROUPS", MAX_GROUPS),
        ("NUM_GROUPS", NUM_GROUPS),
        ("GROUPS_ONE", Groups::One as u32),
        ("GROUPS_ONE_LATER", Groups::OneLater as u32),
        ("GROUPS_LISTED_BLOCKS", Groups::ListedBlocks as u32),
        ("GROUPS_EACH_LISTED", Groups::EachListed as u32),
        ("GROUPS_EACH_VISIBLE", Groups::EachVisible as u32),
        ("GROUPS_VISIBLE", Groups::Visible as u32),
        ("GROUPS_VISIBLE_BLOCKS", Groups::VisibleBlocks as u32),
        ("GROUPS_VISIBLE_DIGITS", Groups::VisibleDigits as u32),
        ("GROUPS_PAIR_DIGITS", Groups::PairDigits as u32),
        ("GROUPS_TILES", Groups::Tiles as u32),
        ("GROUPS_SEGMENTS", Groups::Segments as u32),
        ("GROUPS_LOSS_TILES", Groups::LossTiles as u32),
        ("GROUPS_PAIRS_AND_TILES", Groups::PairsAndTiles as u32),
        ("GROUPS_PAIR_BLOCKS", Groups::PairBlocks as u32),
        ("GROUPS_VISIBLE_TOTALS", Groups::VisibleTotals as u32),
    ];
    (floats, integers)
}

fn constants() -> Vec<String> {
    let (floats, integers) = shared_constants();
    let mut out: Vec<String> =
        floats.iter().map(|(name, value)| format!("const {name}: f32 = {};", float(*value))).collect();
    out.extend(integers.iter().map(|(name, value)| format!("const {name}: u32 = {value}u;")));
    let array = |name: &str, values: &[f64]| {
        let mut text = format!("const {name} = array<f32, {}>(", values.len());
        for (i, value) in values.iter().enumerate() {
            let _ = write!(text, "{}{}", if i > 0 { ", " } else { "" }, float(*value));
        }
        text + ");"
    };
    out.push(array("SSIM_WINDOW", &c::ssim_window()));
    out.push(array("SH_2", &c::SH_2));
    out.push(array("SH_3", &c::SH_3));
    out
}

/// A float literal that WGSL parses back to the same f32.
fn float(value: f64) -> String {
    format!("{:?}", value as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expanded_lines_keep_their_origin() {
        let expanded = expand("project", &[]).unwrap();
        let line = expanded.text.lines().position(|l| l.starts_with("fn project(")).unwrap() as u32 + 1;
        assert!(expanded.origin(line).starts_with("shaders/project.wgsl:"), "{}", expanded.origin(line));
        assert!(!expanded.text.contains("\n#"), "a directive is left");
    }

    #[test]
    fn a_missing_file_is_named_in_the_error() {
        assert!(expand("nothing", &[]).unwrap_err().contains("nothing"));
    }

    #[test]
    fn float_literals_round_trip_exactly() {
        for value in [c::ALPHA_MIN, c::ADAM_EPSILON, c::TRANSMITTANCE_MIN] {
            assert_eq!(float(value).parse::<f32>().unwrap(), value as f32);
        }
    }
}
