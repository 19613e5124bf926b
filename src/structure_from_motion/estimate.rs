//! How long finding the poses takes. Measured on two cores with the 50 photos of fox (0.8 MP each within 1,200 px): pycolmap
//! 4.2.1 26 s for features, 43 s for 1,225 pairs, 24 s for mapping; COLMAP 3.8 34, 231, 51 s, and with its defaults
//! (2 MP, 8,192 features) 51, 384, 64 s.

use super::engine::{Engine, Step};
use super::settings::PoseQuality;

/// Seconds of two cores for each photo, and for each megapixel in it.
const FEATURES: (f64, f64) = (0.34, 0.21);

/// Seconds of two cores for each pair.
const PAIR: f64 = 0.035;

/// Seconds for each photo.
const MAPPED: f64 = 0.48;

/// COLMAP 3.8 beside pycolmap, for each step.
const COLMAP: [f64; 3] = [1.3, 5.4, 2.1];

/// 8,192 features beside 3,000.
const FULL: [f64; 3] = [1.0, 1.7, 1.3];

/// Seconds of the three steps. `sizes` are those of the photos, `pairs` is their number.
pub fn secs(
    engine: &Engine,
    quality: PoseQuality,
    sizes: &[(u32, u32)],
    pairs: usize,
    cores: usize,
) -> [f64; 3] {
    let side_max = f64::from(quality.side_max_px());
    let megapixels = |(width, height): &(u32, u32)| {
        let (width, height) = (f64::from(*width), f64::from(*height));
        let share = (side_max / width.max(height)).min(1.0);
        width * height * share * share * 1e-6
    };
    let features: f64 = sizes.iter().map(|size| FEATURES.0 + FEATURES.1 * megapixels(size)).sum();
    // Bundle adjustment hardly gains from more cores.
    let faster = 2.0 / cores.clamp(1, 64) as f64;
    let plain =
        [features * faster, PAIR * pairs as f64 * faster, MAPPED * sizes.len() as f64 * faster.max(0.5)];
    let is_older = matches!(engine, Engine::Colmap { version, .. } if *version < (4, 0));
    [Step::Features, Step::Matching, Step::Mapping].map(|step| {
        let at = step as usize;
        let engine = if is_older { COLMAP[at] } else { 1.0 };
        plain[at] * engine * if quality == PoseQuality::Full { FULL[at] } else { 1.0 }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimates_are_the_measurements() {
        let fox = vec![(1067, 1899); 50];
        let pycolmap = Engine::Pycolmap { python: "p".into(), version: (4, 2) };
        let colmap = Engine::Colmap { program: "c".into(), version: (3, 8), has_gpu: false };
        for (engine, quality, measured) in [
            (&pycolmap, PoseQuality::Fast, [26.0, 43.0, 24.0]),
            (&colmap, PoseQuality::Fast, [34.0, 231.0, 51.0]),
            (&colmap, PoseQuality::Full, [51.0, 384.0, 64.0]),
        ] {
            let found = secs(engine, quality, &fox, 1225, 2);
            for (found, measured) in found.iter().zip(measured) {
                assert!((found / measured - 1.0_f64).abs() < 0.05, "{found} s, {measured} s measured");
            }
        }
    }
}
