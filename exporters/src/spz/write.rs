//! Writes SPZ versions 3 and 4.

use super::{ANTIALIASED, COLOUR_SCALE, MAGIC, ShBits, SpzOptions, SpzVersion, gzip, rotation, zstd_streams};
use crate::asset::meta::Meta;
use crate::fallback::baked::{Baked, Baker};
use crate::fallback::spacing::{Spacing, Spacings};
use crate::math::sh::Turn;
use crate::math::yup;
use crate::{Filter, ORIGIN_OPTION, Result, SplatAsset};

/// Fractional bits of positions that other programs accept.
const FRACTIONAL_BITS: std::ops::RangeInclusive<u32> = 4..=23;
/// Largest fixed-point number of 24 bits.
const FIXED_MAX: f64 = 8_388_607.0;

/// Facts about a file that was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpzSummary {
    /// Size of the file.
    pub bytes: usize,
    /// Splats whose maps were averaged into their colours.
    pub averaged_maps: usize,
    /// How finely 24 bits resolve the splats.
    pub spacing: Spacing,
    /// Splats with a scale outside the range of 8 bits (4.5e-5 to 380 units), not counting the thin axis.
    pub clamped_scales: usize,
}

/// Encodes a file.
///
/// # Errors
/// [`crate::Error::Invalid`] if the asset breaks a rule or its centres lie too far out, [`crate::Error::TooLarge`] also for
/// more cameras than version 3 has room for.
pub fn encode_spz(asset: &SplatAsset, options: &SpzOptions) -> Result<(Vec<u8>, SpzSummary)> {
    asset.validate()?;
    let baker = Baker::new(asset);
    let n = asset.num_splats();
    let extent = (0..n).flat_map(|i| baker.position(i)).fold(0.0_f64, |a, v| a.max(v.abs()));
    let fits = |bits: &u32| extent * f64::from(1_u32 << bits) <= FIXED_MAX;
    let fractional_bits = FRACTIONAL_BITS.rev().find(fits).ok_or_else(|| {
        invalid!(
            "",
            "SPZ holds coordinates up to 524,287 units; these reach {extent:.3e}: move the origin of the file to the scene with \
             {ORIGIN_OPTION} of litetex export; if that does not help, use larger units (--scale) or leave out what lies far \
             away (--crop)"
        )
    })?;
    let (step, mut spacings) = (1.0 / f64::from(1_u32 << fractional_bits), Spacings::default());
    let mut streams: [Vec<u8>; super::NUM_STREAMS] = Default::default();
    let mut summary = SpzSummary::default();
    let half_turn = Turn::new([0.0, 1.0, 0.0, 0.0]);
    for i in 0..n {
        let splat = baker.splat(i);
        push(&mut streams, &splat, (step, options.sh_bits), &half_turn, &mut summary);
        summary.averaged_maps += usize::from(asset.maps[i].num_texels() > 0);
        spacings.add(&splat, step);
    }
    summary.spacing = spacings.summary();
    let bytes = file(asset, options, fractional_bits, &streams)?;
    summary.bytes = bytes.len();
    Ok((bytes, summary))
}

/// Appends a splat to the streams; `step` is that of coordinates.
fn push(
    streams: &mut [Vec<u8>; 6],
    splat: &Baked,
    (step, sh_bits): (f64, ShBits),
    half_turn: &Turn,
    summary: &mut SpzSummary,
) {
    let [positions, alphas, colours, scales, rotations, sh] = streams;
    let [x, y, z] = splat.position;
    for v in [x, -y, -z] {
        let fixed = (v / step).round().clamp(-FIXED_MAX, FIXED_MAX);
        positions.extend_from_slice(&(fixed as i32).to_le_bytes()[..3]);
    }
    let byte = |v: f64| v.round().clamp(0.0, 255.0) as u8;
    alphas.push(byte(f64::from(splat.opacity) * 255.0));
    colours.extend(splat.sh[..3].iter().map(|c| byte(c * COLOUR_SCALE * 255.0 + 127.5)));
    let codes = splat.scales.map(|s| (s.ln() + 10.0) * 16.0);
    summary.clamped_scales += usize::from(codes.iter().any(|c| !(-0.5..255.5).contains(c)));
    scales.extend(codes.map(byte));
    // The thin axis, as thin as can be.
    scales.push(0);
    let [w, x, y, z] = yup::rotation(splat.rotation).map(f64::from);
    rotations.extend(rotation::encode([x, y, z, w]).to_le_bytes());
    let coefficients: Vec<f32> = splat.sh.iter().map(|&c| c as f32).collect();
    let flipped = half_turn.apply(&coefficients);
    for (i, c) in flipped.iter().enumerate().skip(3) {
        let step = f64::from(sh_bits.step(i / 3));
        sh.push(byte(((c * 128.0 + 128.0) / step).round() * step));
    }
}

fn file(
    asset: &SplatAsset,
    options: &SpzOptions,
    fractional_bits: u32,
    streams: &[Vec<u8>; 6],
) -> Result<Vec<u8>> {
    let meta = serde_json::to_vec(&meta(asset, options.cameras));
    let meta = meta.map_err(|e| invalid!("", "metadata: {e}"))?;
    let mut header = Vec::new();
    for word in [MAGIC, options.version.number(), asset.num_splats() as u32] {
        header.extend(word.to_le_bytes());
    }
    let flags = if asset.filter == Filter::Ewa { ANTIALIASED } else { 0 };
    header.extend([asset.sh_degree as u8, fractional_bits as u8, flags, 0]);
    match options.version {
        SpzVersion::V3 => gzip::pack(&header, streams, &meta),
        SpzVersion::V4 => zstd_streams::pack(&header, streams, &meta),
    }
}

/// What the file keeps of the metadata: not the facts about the training, and cameras only if they are asked for.
fn meta(asset: &SplatAsset, cameras: bool) -> Meta {
    let mut meta = Meta::with_short_cameras(asset);
    meta.provenance.training.clear();
    if !cameras {
        meta.cameras.clear();
        meta.home = None;
    }
    meta
}

/// The SH coefficient of degree 0 that a code stands for.
pub(super) fn dc_from_code(code: u8) -> f64 {
    (f64::from(code) / 255.0 - 0.5) / COLOUR_SCALE
}
