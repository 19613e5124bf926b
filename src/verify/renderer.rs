//! Renders assets on any backend.

use crate::backend::{Backend, RenderOptions, RenderedImage};
use crate::bake::{camera, model_from_asset};
use crate::model::AdamState;
use crate::{Error, Result};
use litetex_exporters::{AssetCamera, ColourSpace, SplatAsset};

/// Asked before each view; `false` ends the work with [`Error::Interrupted`].
pub type GoOn<'a> = &'a dyn Fn() -> bool;

/// A backend that renders one asset after another.
pub struct SceneRenderer<'a> {
    backend: Box<dyn Backend>,
    options: RenderOptions,
    colour_space: ColourSpace,
    go_on: GoOn<'a>,
}

impl<'a> SceneRenderer<'a> {
    /// A renderer without a scene.
    pub fn new(backend: Box<dyn Backend>, go_on: GoOn<'a>) -> Self {
        let options = RenderOptions { background: [0.0; 3], sh_degree: 0, geometry: false };
        Self { backend, options, colour_space: ColourSpace::default(), go_on }
    }

    /// The asset seen from each of the views, in sRGB code values.
    ///
    /// # Errors
    /// What the device reports, such as a scene that does not fit; [`Error::Interrupted`].
    pub fn images(&mut self, asset: &SplatAsset, views: &[AssetCamera]) -> Result<Vec<RenderedImage>> {
        let model = model_from_asset(asset);
        self.options.sh_degree = asset.sh_degree;
        self.options.background = asset.background;
        self.colour_space = asset.colour_space;
        self.backend.upload(&model, &AdamState::zeros(&model))?;
        views.iter().map(|view| self.image(view)).collect()
    }

    fn image(&mut self, view: &AssetCamera) -> Result<RenderedImage> {
        if !(self.go_on)() {
            return Err(Error::Interrupted);
        }
        let mut image = self.backend.render(&camera(view), &self.options)?;
        to_display(&mut image, self.colour_space);
        Ok(image)
    }
}

/// Converts colours that were blended in another space to sRGB code values, the colours of images.
pub fn to_display(image: &mut RenderedImage, space: ColourSpace) {
    if space != ColourSpace::SrgbRec709Display {
        image.rgb.iter_mut().for_each(|v| *v = space.srgb((*v).into()) as f32);
    }
}
