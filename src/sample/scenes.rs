//! Scenes other than the still life: names, levels and what each shows. All stand in front of cameras on a cap, and
//! everything around them has one colour, that of the background. The smallest models of all but the poster are known.
//! `patch`, `planted` and `poster` have their contents.

use super::levels::{Kinds, Leveled, Row};
use serde::{Deserialize, Serialize};

/// What is shown. Colours are in display space and need no light; only `Gloss` depends on the direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneKind {
    /// A square with a grid of random colours, interpolated.
    Wall,
    /// Nothing but the colour of the background.
    Flat,
    /// A square of four quadrants: the colour of the background, a ramp, a coarse and a fine grid.
    Quilt,
    /// A square with parallel stripes of random colours, interpolated.
    Stripes,
    /// Splats with texture maps that do not overlap.
    Planted,
    /// A wall with a gloss on a tenth of it.
    Gloss,
    /// A poster with noise as in photos, sharp borders and lettering: no smallest model of it is known.
    Poster,
}

use SceneKind as Kind;

impl Kinds for Kind {
    const WORD: &'static str = "scene";
    const ROWS: &'static [Row<Kind>] = &[
        (Kind::Wall, "wall", 8.0, [2.0, 64.0], "colours along each side"),
        (Kind::Flat, "flat", 0.0, [0.0, 10.0], "largest dither, of 255"),
        (Kind::Quilt, "quilt", 0.0, [0.0, 0.0], ""),
        (Kind::Stripes, "stripes", 0.0, [-180.0, 180.0], "degrees by which the square is turned"),
        (Kind::Planted, "planted", 0.0, [0.0, 0.0], ""),
        (Kind::Gloss, "gloss", 0.0, [0.0, 0.0], ""),
        (Kind::Poster, "poster", 7.0, [1.0, 12.0], "octaves of detail"),
    ];

    fn problem(self, level: f64) -> Option<&'static str> {
        match self {
            _ if level.fract() == 0.0 => None,
            Kind::Wall => Some("expected a whole number of colours"),
            Kind::Poster => Some("expected a whole number of octaves"),
            _ => None,
        }
    }
}

/// What is shown, and how large, strong or turned it is.
pub type NamedScene = Leveled<SceneKind>;
