//! `litetex render --colour-by`: splats coloured by one of their properties, with a legend.
//! The classes are fixed, so that images of different runs can be compared.

use litetex_gs::camera::Camera;
use litetex_gs::console::Table;
use litetex_gs::constants::SH_DEGREE_MAX;
use litetex_gs::image::{Channels, legend, magma, write_png};
use litetex_gs::model::tint::tinted;
use litetex_gs::model::{Model, TextureMap};
use litetex_gs::text::format_count;
use litetex_gs::train::density::pixel_sizes;
use litetex_gs::{Error, Result};
use std::path::{Path, PathBuf};

/// What the colour of a splat shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ColourBy {
    /// Texels along the longer side of its map
    Texels,
    /// Size of its texels, in pixels of the nearest training camera
    TexelSize,
    /// SH degree: how its colour depends on the direction of view
    Degree,
    /// Identity: every splat gets its own colour, distinct from its neighbours'
    Splats,
}

/// Splats without a map: a hue that is not on the ramp, for colour-blind readers too (sky blue of Okabe and Ito).
const NONE: [u8; 3] = [86, 180, 233];
/// Darkest place used on the ramp: darker colours vanish on a black background.
const DARKEST: f64 = 0.2;
/// Classes of either measure of texels besides "none": sides of 2 to 256 texels, texels of up to 1 to 64 pixels and more.
const CLASSES: usize = TextureMap::SIDE_CLASSES;

impl ColourBy {
    /// Name on the command line and in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Texels => "texels",
            Self::TexelSize => "texel-size",
            Self::Degree => "degree",
            Self::Splats => "splats",
        }
    }

    /// Where the legend is written; `None` for colours that mean nothing. No view's image has this name: theirs end in
    /// the name of what they show.
    pub fn legend_path(self, folder: &Path) -> Option<PathBuf> {
        (self != Self::Splats).then(|| folder.join(format!("{}.legend.png", self.name())))
    }

    fn title(self) -> &'static str {
        match self {
            Self::TexelSize => "pixels per texel",
            Self::Degree => "SH degree",
            _ => "texels per side",
        }
    }

    /// Number of classes besides the first.
    fn num_classes(self) -> usize {
        if self == Self::Degree { SH_DEGREE_MAX as usize } else { CLASSES }
    }

    /// Labels of the classes, from that of splats without a map or of degree 0.
    fn labels(self) -> Vec<String> {
        let class = |class: usize| match self {
            Self::Degree => class.to_string(),
            _ if class == 0 => "none".to_owned(),
            Self::TexelSize if class == CLASSES => format!("{}+", 1 << (class - 2)),
            Self::TexelSize => (1 << (class - 1)).to_string(),
            _ => (1 << class).to_string(),
        };
        (0..=self.num_classes()).map(class).collect()
    }

    /// Class of a splat; `pixel` is the width of a pixel of the nearest camera there, local units.
    fn class(self, map: &TextureMap, sh_degree: u8, pixel: f64) -> usize {
        let side_class = map.side_class();
        match self {
            Self::Degree => sh_degree.into(),
            _ if side_class == 0 => 0,
            Self::TexelSize => {
                let size = f64::from(map.texel_sizes[0].min(map.texel_sizes[1])) / pixel;
                // Resampling leaves sizes slightly above a power of two.
                (size.log2() - 0.05).ceil().clamp(0.0, (CLASSES - 1) as f64) as usize + 1
            }
            _ => side_class,
        }
    }
}

/// Colour of a class: the finer the maps or the higher the degree, the lighter.
fn colour(by: ColourBy, class: usize) -> [u8; 3] {
    if class == 0 {
        return NONE;
    }
    let step = (class - 1) as f64 / (by.num_classes() - 1) as f64;
    let lightness = if by == ColourBy::TexelSize { 1.0 - step } else { step };
    magma(DARKEST + (1.0 - DARKEST) * lightness)
}

/// A colour for a number, far from those of the next numbers.
fn scattered(number: usize) -> [u8; 3] {
    let hashed = (number as u32).wrapping_add(1).wrapping_mul(0x9E37_79B1);
    let hashed = (hashed ^ hashed >> 15).wrapping_mul(0x85EB_CA77);
    [0, 8, 16].map(|shift| 40 + (hashed >> shift & 0xFF) as u8 % 216)
}

/// A scene in these colours, with counts for the legend.
pub struct Coloured {
    by: ColourBy,
    pub model: Model,
    /// Splats and texels of each class; empty where colours mean nothing.
    counts: Vec<[usize; 2]>,
}

impl Coloured {
    /// Colours the splats of a model; `cameras` are those of the training views at the size trained.
    pub fn new(by: ColourBy, model: &Model, cameras: &[Camera]) -> Self {
        let n = model.num_splats();
        if by == ColourBy::Splats {
            let colours: Vec<[u8; 3]> = (0..n).map(scattered).collect();
            return Self { by, model: tinted(model, &colours), counts: Vec::new() };
        }
        let mut counts = vec![[0; 2]; by.num_classes() + 1];
        let pixels = pixel_sizes(model, cameras);
        let maps_and_degrees = model.textures.maps.iter().zip(model.splats.sh_degrees());
        let colours = maps_and_degrees.zip(&pixels).map(|((map, &sh_degree), &pixel)| {
            let class = by.class(map, sh_degree, pixel);
            counts[class][0] += 1;
            counts[class][1] += map.num_texels();
            colour(by, class)
        });
        let colours: Vec<[u8; 3]> = colours.collect();
        Self { by, model: tinted(model, &colours), counts }
    }

    /// Writes the legend, for colours that mean something.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write_legend(&self, folder: &Path) -> Result<Option<PathBuf>> {
        let Some(path) = self.by.legend_path(folder) else { return Ok(None) };
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e))?;
        let labels = self.by.labels().into_iter().enumerate();
        let entries: Vec<_> = labels.map(|(class, label)| (label, colour(self.by, class))).collect();
        let (width_px, height_px, rgb) = legend(self.by.title(), &entries);
        write_png(&path, width_px, height_px, Channels::Rgb, &rgb)?;
        Ok(Some(path))
    }

    /// Adds the classes with their colours and counts to a table.
    pub fn add_rows(&self, table: &mut Table) {
        if self.counts.is_empty() {
            return;
        }
        table.row(self.by.title(), "colour, splats, texels");
        for ((class, label), [splats, texels]) in self.by.labels().iter().enumerate().zip(&self.counts) {
            let [r, g, b] = colour(self.by, class);
            let [splats, texels] = [splats, texels].map(|&count| format_count(count as u64));
            table.row(&format!("  {label}"), format!("#{r:02x}{g:02x}{b:02x}, {splats}, {texels}"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use litetex_gs::selftest::{SceneOptions, random_scene};

    /// How people without red, green or blue receptors see a colour, linear RGB (Machado, Oliveira and
    /// Fernandes 2009, severity 1).
    const SIGHTS: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ];

    /// Least difference of two colours to any of these eyes: distance in display space, 0 to 441.
    fn difference(a: [u8; 3], b: [u8; 3]) -> f64 {
        let seen = |colour: [u8; 3], sight: &[[f64; 3]; 3]| {
            let linear = colour.map(|c| (f64::from(c) / 255.0).powf(2.2));
            sight.map(|row| {
                let value: f64 = row.iter().zip(linear).map(|(w, v)| w * v).sum();
                255.0 * value.clamp(0.0, 1.0).powf(1.0 / 2.2)
            })
        };
        let distances = SIGHTS.iter().map(|sight| {
            let (a, b) = (seen(a, sight), seen(b, sight));
            a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        });
        distances.fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn classes_are_distinguishable_with_any_colour_vision() {
        for by in [ColourBy::Texels, ColourBy::TexelSize, ColourBy::Degree] {
            let colours: Vec<[u8; 3]> = (0..=by.num_classes()).map(|class| colour(by, class)).collect();
            for (i, &a) in colours.iter().enumerate() {
                for &b in &colours[..i] {
                    assert!(difference(a, b) > 25.0, "{by:?}: {a:?} {b:?}: {}", difference(a, b));
                }
            }
        }
        // Negative control: traffic lights.
        assert!(difference([150, 60, 40], [70, 80, 40]) < 5.0);
    }

    #[test]
    fn maps_are_counted_in_the_class_of_their_longer_side_and_of_their_texels() {
        let sizes = vec![(2, 2), (4, 2), (6, 8), (1, 1), (255, 3)];
        let options = SceneOptions { num_splats: 10, map_sizes: sizes, ..SceneOptions::default() };
        let mut scene = random_scene(&options);
        let coloured = Coloured::new(ColourBy::Texels, &scene.model, &[scene.camera]);
        let splats: Vec<usize> = coloured.counts.iter().map(|c| c[0]).collect();
        assert_eq!(splats.iter().sum::<usize>(), 10);
        assert_eq!(coloured.counts.iter().map(|c| c[1]).sum::<usize>(), scene.model.num_texels());
        let labels = ColourBy::Texels.labels();
        let class = |side: u16| {
            let map = TextureMap::square(1, side, 1.0);
            labels[ColourBy::Texels.class(&map, 0, 1.0)].as_str()
        };
        assert_eq!([1, 2, 3, 4, 8, 9, 255, 256].map(class), ["2", "2", "4", "4", "8", "16", "256", "256"]);
        // Texels of 0.7 to 1000 pixels.
        let labels = ColourBy::TexelSize.labels();
        let class = |texel_size: f32| {
            let map = TextureMap::centred(2, 2, [texel_size, 2.0 * texel_size]);
            labels[ColourBy::TexelSize.class(&map, 0, 0.1)].as_str()
        };
        let sizes = [0.07, 0.1, 0.2, 0.2001, 0.3, 6.4, 6.9, 100.0];
        assert_eq!(sizes.map(class), ["1", "1", "2", "2", "4", "64", "64+", "64+"]);
        // Without maps there is one class.
        scene.model = coloured.model;
        let plain = Coloured::new(ColourBy::TexelSize, &scene.model, &[scene.camera]);
        assert_eq!(
            (plain.counts[0], plain.model.splats.sh[..3] == scene.model.splats.sh[..3]),
            ([10, 0], false)
        );
    }

    #[test]
    fn neighbouring_splats_have_distinct_colours() {
        let colours: Vec<[u8; 3]> = (0..1000).map(scattered).collect();
        let close = colours.windows(2).filter(|w| difference(w[0], w[1]) < 15.0).count();
        assert!(close < 60, "{close}");
        assert!(colours.iter().all(|c| c.iter().all(|&v| v >= 40)));
    }
}
