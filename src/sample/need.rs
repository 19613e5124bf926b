//! Scenes whose smallest model is known: names, levels and what each shows. All stand in front of cameras on a cap, and
//! everything around them has one colour, that of the background. `patch` and `planted` have their contents.

use super::levels::{Kinds, Leveled, Row};
use serde::{Deserialize, Serialize};

/// What is shown. Colours are in display space and need no light; only `Gloss` depends on the direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NeedKind {
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
}

use NeedKind as Kind;

impl Kinds for Kind {
    const WORD: &'static str = "scene";
    const ROWS: &'static [Row<Kind>] = &[
        (Kind::Wall, "wall", 8.0, [2.0, 64.0], "colours along each side"),
        (Kind::Flat, "flat", 0.0, [0.0, 10.0], "largest dither, of 255"),
        (Kind::Quilt, "quilt", 0.0, [0.0, 0.0], ""),
        (Kind::Stripes, "stripes", 0.0, [-180.0, 180.0], "degrees by which the square is turned"),
        (Kind::Planted, "planted", 0.0, [0.0, 0.0], ""),
        (Kind::Gloss, "gloss", 0.0, [0.0, 0.0], ""),
    ];

    fn problem(self, level: f64) -> Option<&'static str> {
        (self == Kind::Wall && level.fract() != 0.0).then_some("expected a whole number of colours")
    }
}

/// What is shown, and how large, strong or turned it is.
pub type NeedScene = Leveled<NeedKind>;
