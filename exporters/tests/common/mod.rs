//! Scenes for the integration tests.

use litetex_exporters::{AssetCamera, AssetMap, SplatAsset, Transform, num_sh_coefficients};

/// Pseudo-random splats with maps of several shapes, every third without; a camera and a frame.
pub fn scene(num_splats: usize, sh_degree: u32) -> SplatAsset {
    let mut state = 11_u32;
    let mut random = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / 16_777_216.0
    };
    let mut asset = SplatAsset {
        sh_degree,
        capture_from_local: Transform::scaled_and_moved(3.7, [10.0, -4.0, 0.5]),
        cameras: vec![camera()],
        ..SplatAsset::default()
    };
    for i in 0..num_splats {
        asset.positions.push([random() - 0.5, random() - 0.5, random()]);
        let q: [f64; 4] = std::array::from_fn(|_| f64::from(random()) - 0.5);
        let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        asset.rotations.push(q.map(|v| (v / norm) as f32));
        asset.scales.push([0.01 + 0.1 * random(), 0.01 + 0.1 * random()]);
        asset.opacities.push(0.02 + 0.97 * random());
        let degree = [sh_degree, 0, sh_degree.min(1)][i % 3];
        asset.sh_degrees.push(degree as u8);
        asset.sh.extend((0..3 * num_sh_coefficients(degree)).map(|_| random() - 0.5));
        asset.sh.resize(asset.num_splats() * 3 * num_sh_coefficients(sh_degree), 0.0);
        let (rows, cols) = [(2, 2), (0, 0), (5, 3)][i % 3];
        let offset_texels = asset.num_texels() as u32;
        let mut map = AssetMap { offset_texels, rows, cols, ..AssetMap::default() };
        if rows > 0 {
            map.texel_sizes = [[0.02; 2], [0.02, 0.04]][i / 3 % 2];
            map.shift = [[0, 0], [1, 0], [-2, 3]][i / 3 % 3];
        }
        asset.texels.extend((0..3 * map.num_texels()).map(|_| 1.6 * (random() - 0.5)));
        asset.maps.push(map);
    }
    asset.provenance.title = "Scene".to_owned();
    asset.validate().expect("a valid scene");
    asset
}

fn camera() -> AssetCamera {
    AssetCamera {
        name: "frame 1.png".into(),
        held_out: true,
        width_px: 640,
        height_px: 480,
        focal_px: [500.5, 501.25],
        principal_px: [320.0, 240.5],
        rotation_rows: [[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]],
        translation: [0.1, 0.2, 1.0 / 3.0],
    }
}
