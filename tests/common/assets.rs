//! An asset for tests, and helpers to write, read and render assets.

use litetex_exporters::{Format, Quality, ReadLimits, SplatAsset, WriteOptions, read_asset, write_asset};
use litetex_gs::Report;
use litetex_gs::backend::{Backend, RenderOptions};
use litetex_gs::bake::{asset_camera, bake, camera, model_from_asset};
use litetex_gs::model::AdamState;
use litetex_gs::selftest::{SceneOptions, random_scene};
use std::path::Path;

/// An asset with SH of degree 3, rectangular maps of several sizes, untextured splats, and three cameras whose
/// principal points are off centre.
pub fn asset() -> SplatAsset {
    let scene = random_scene(&SceneOptions {
        num_splats: 400,
        sh_degree: 3,
        map_sizes: vec![(4, 4), (0, 0), (9, 3), (2, 16), (7, 7)],
        width_px: 64,
        height_px: 48,
        scales: (0.04, 0.2),
        opacities: (0.1, 0.99),
        depths: (0.8, 2.0),
        ..SceneOptions::default()
    });
    let cameras = (0..3).map(|i| {
        let mut camera = scene.camera;
        camera.camera_from_local.translation.x += 0.1 * f64::from(i - 1);
        camera.pinhole.cx_px += 5.0 * f64::from(i);
        camera.pinhole.fy_px *= 1.1;
        asset_camera(&format!("{i}.png"), i == 0, &camera)
    });
    bake(&scene.model, cameras.collect(), [0.2, 0.4, 0.1], Default::default(), &mut Report::default())
}

/// Renders an asset from the cameras of `views`; the images are concatenated.
pub fn images(backend: &mut dyn Backend, asset: &SplatAsset, views: &SplatAsset) -> Vec<f32> {
    let model = model_from_asset(asset);
    backend.upload(&model, &AdamState::zeros(&model)).unwrap();
    let options = RenderOptions { background: asset.background, sh_degree: asset.sh_degree, geometry: false };
    let render = |view| backend.render(&camera(view), &options).unwrap().rgb;
    views.cameras.iter().flat_map(render).collect()
}

/// PSNR between images, of values clamped to [0, 1].
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2));
    -10.0 * (squares.sum::<f64>() / a.len() as f64).log10()
}

/// Writes an asset and reads it back.
pub fn through(folder: &Path, asset: &SplatAsset, format: Format, quality: Quality) -> SplatAsset {
    let path = folder.join(format!("{}.{}", quality.name(), format.extension()));
    write_asset(&path, asset, &WriteOptions { quality, ..WriteOptions::default() }).unwrap();
    let contents = read_asset(&path, &ReadLimits::default()).unwrap();
    if format.keeps_textures() {
        assert_eq!(contents.hash, Some(contents.asset.hash()), "{format:?} {quality:?}");
        assert_eq!(contents.quality, Some(quality));
        assert!(contents.warnings.is_empty(), "{:?}", contents.warnings);
    }
    contents.asset
}
