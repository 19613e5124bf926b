//! The tiles and row spans on which the CPU backend evaluates a splat include every pixel where its alpha reaches
//! 1/255, and few others.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use glam::DVec2;
use litetex_gs::backend::Backend as _;
use litetex_gs::backend::ColourMap;
use litetex_gs::cpu::CpuBackend;
use litetex_gs::model::AdamState;
use litetex_gs::reference::{AlphaCutoff, ColourGradient, Params, Settings, hit, pixel_bounds, project};
use litetex_gs::selftest::{RandomScene, SceneOptions, random_scene};

fn settings(scene: &RandomScene) -> Settings {
    Settings {
        cutoff: AlphaCutoff::Hard,
        colour_gradient: ColourGradient::Strict,
        near: f64::from(scene.model.near),
        filter_px2: scene.model.filter.variance_px2(),
        sh_degree: 0,
        background: [0.0; 3],
        exposure: ColourMap::IDENTITY,
    }
}

/// Pixel-splat pairs.
struct PixelCounts {
    /// Pairs with alpha >= 1/255.
    inside: usize,
    /// Inside, but not evaluated.
    missed: usize,
    /// Inside, but not in the reference's box.
    outside_box: usize,
    /// Evaluated pairs.
    covered: usize,
}

fn count_pixels(options: &SceneOptions) -> PixelCounts {
    let scene = random_scene(options);
    let settings = settings(&scene);
    let params = Params::from_model(&scene.model);
    let mut backend = CpuBackend::new(Some(1)).unwrap();
    backend.upload(&scene.model, &AdamState::zeros(&scene.model)).unwrap();
    let coverage = backend.coverage(&scene.camera);
    let (w, h) = (options.width_px as usize, options.height_px as usize);
    let mut covered_by: Vec<Option<&Vec<bool>>> = vec![None; params.splats.len()];
    coverage.iter().for_each(|c| covered_by[c.splat] = Some(&c.covered));
    let mut out = PixelCounts { inside: 0, missed: 0, outside_box: 0, covered: 0 };
    for (i, covered) in covered_by.iter().enumerate() {
        let Some(p) = project(&params, i, &scene.camera, &settings) else {
            continue;
        };
        let bounds = pixel_bounds(&p, &scene.camera, settings.near);
        for pixel in 0..w * h {
            let (x, y) = (pixel % w, pixel / w);
            let is_covered = covered.is_some_and(|c| c[pixel]);
            out.covered += usize::from(is_covered);
            if hit(&p, DVec2::new(x as f64 + 0.5, y as f64 + 0.5), &settings).is_some() {
                out.inside += 1;
                out.missed += usize::from(!is_covered);
                let in_box = bounds.is_some_and(|b| {
                    (b.x0..b.x1).contains(&(x as u32)) && (b.y0..b.y1).contains(&(y as u32))
                });
                out.outside_box += usize::from(!in_box);
            }
        }
    }
    out
}

#[test]
fn no_pixel_lies_outside_its_bounds() {
    let base =
        SceneOptions { num_splats: 600, map_sizes: vec![(0, 0)], sh_degree: 0, ..SceneOptions::default() };
    let cases = [
        ("ordinary", 13, base.clone()),
        (
            "large and near",
            13,
            SceneOptions { scales: (0.1, 3.0), depths: (0.041, 0.5), seed: 2, ..base.clone() },
        ),
        ("tiny", 400, SceneOptions { scales: (1e-4, 0.01), seed: 3, ..base.clone() }),
        ("needles", 80, SceneOptions { scales: (1e-4, 2.0), seed: 4, ..base.clone() }),
        ("wide image", 16, SceneOptions { width_px: 1500, height_px: 37, num_splats: 150, seed: 5, ..base }),
    ];
    for (name, limit, options) in cases {
        let out = count_pixels(&options);
        println!("{name}: inside {} covered {} missed {}", out.inside, out.covered, out.missed);
        assert!(out.inside > 400, "{name}: too few visible pixels: {}", out.inside);
        assert_eq!(out.missed, 0, "{name}: pixels with alpha >= 1/255 that are not evaluated");
        assert_eq!(out.outside_box, 0, "{name}: pixels outside the reference's exact box");
        // Bounds that exclude nothing would pass the above.
        assert!(
            out.covered * 10 < out.inside * limit,
            "{name}: {} covered, {} inside",
            out.covered,
            out.inside
        );
    }
}
