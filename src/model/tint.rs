//! Models whose splats have one flat colour each, to show something other than the scene's colours.

use super::{Model, TextureMap, TexturePool};
use crate::constants::SH_0;

/// The model with one display-space colour for each splat, the same from all sides, instead of spherical
/// harmonics and texture. Shapes, opacities and order stay.
///
/// # Panics
/// If there is not one colour for each splat.
pub fn tinted(model: &Model, colours: &[[u8; 3]]) -> Model {
    let n = model.num_splats();
    assert_eq!(colours.len(), n, "one colour for each splat");
    let coefficient = |c: u8| ((f64::from(c) / 255.0 - 0.5) / SH_0) as f32;
    let mut splats = model.splats.clone();
    splats.set_sh_degrees(&vec![0; n]);
    splats.sh = colours.iter().flatten().map(|&c| coefficient(c)).collect();
    Model {
        splats,
        textures: TexturePool { maps: vec![TextureMap::default(); n], texels: Vec::new() },
        ..*model
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::{Backend as _, RenderOptions};
    use crate::cpu::CpuBackend;
    use crate::model::AdamState;
    use crate::selftest::{SceneOptions, random_scene};

    #[test]
    fn tinted_pixels_blend_the_given_colours() {
        let scene = random_scene(&SceneOptions { num_splats: 200, ..SceneOptions::default() });
        let mut backend = CpuBackend::new(Some(1)).unwrap();
        let mut render = |model: &Model| {
            backend.upload(model, &AdamState::zeros(model)).unwrap();
            let sh_degree = model.splats.sh_degree();
            let options = RenderOptions { background: [0.0; 3], sh_degree, geometry: false };
            backend.render(&scene.camera, &options).unwrap()
        };
        let rgb = [51, 102, 204];
        let image = render(&tinted(&scene.model, &[rgb; 200]));
        let off = |image: &crate::backend::RenderedImage| {
            let pixels = image.rgb.chunks_exact(3).zip(&image.alpha);
            let off = pixels.map(|(p, alpha)| {
                (0..3).map(|c| (p[c] - alpha * f32::from(rgb[c]) / 255.0).abs()).fold(0.0, f32::max)
            });
            off.fold(0.0, f32::max)
        };
        // Needed 3e-7: one splat's colour is the same, however many lie upon each other.
        assert!(off(&image) < 2e-6, "{}", off(&image));
        // Negative control: the scene's own colours; and what is drawn where is the same.
        let own = render(&scene.model);
        assert!(off(&own) > 0.1 && own.alpha == image.alpha);
        assert!(image.alpha.iter().any(|&a| a > 0.5));
    }
}
