//! Scenes whose smallest model is known: names, levels and what each shows. All stand in front of cameras on a cap, and
//! everything around them has one colour, that of the background. `patch` and `planted` have their contents.

use super::levels::{self, Row};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

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

const ROWS: [Row<Kind>; 6] = [
    (Kind::Wall, "wall", 8.0, [2.0, 64.0], "colours along each side"),
    (Kind::Flat, "flat", 0.0, [0.0, 10.0], "largest dither, of 255"),
    (Kind::Quilt, "quilt", 0.0, [0.0, 0.0], ""),
    (Kind::Stripes, "stripes", 0.0, [-180.0, 180.0], "degrees by which the square is turned"),
    (Kind::Planted, "planted", 0.0, [0.0, 0.0], ""),
    (Kind::Gloss, "gloss", 0.0, [0.0, 0.0], ""),
];

/// A kind and its level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NeedScene {
    /// What is shown.
    pub kind: NeedKind,
    /// Its size, strength or angle, in the unit of the kind.
    pub level: f64,
}

impl NeedScene {
    /// All kinds at their default levels.
    pub fn all() -> impl Iterator<Item = Self> {
        ROWS.iter().map(|row| Self { kind: row.0, level: row.2 })
    }

    /// Names, levels and defaults, for the help.
    pub fn help() -> String {
        levels::help(&ROWS)
    }
}

impl FromStr for NeedScene {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, level) = levels::parse(&ROWS, "scene", text)?;
        if kind == Kind::Wall && level.fract() != 0.0 {
            return Err(format!("{text:?}: expected a whole number of colours"));
        }
        Ok(Self { kind, level })
    }
}

impl fmt::Display for NeedScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = ROWS.iter().find(|row| row.0 == self.kind).unwrap_or(&ROWS[0]);
        levels::print(row, self.level, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_levels_are_parsed_and_printed() {
        for scene in NeedScene::all() {
            assert_eq!(scene.to_string().parse(), Ok(scene));
        }
        assert_eq!("wall:16".parse(), Ok(NeedScene { kind: Kind::Wall, level: 16.0 }));
        assert_eq!("stripes:30".parse(), Ok(NeedScene { kind: Kind::Stripes, level: 30.0 }));
        for (wrong, part) in [
            ("fog", "no such scene; there are wall[:8] (colours along each side), flat"),
            ("wall:1", "expected a level of 2 to 64"),
            ("wall:2.5", "expected a whole number"),
            ("wall:nan", "expected a level"),
            ("quilt:1", "quilt has no levels"),
        ] {
            let error = wrong.parse::<NeedScene>().unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
