//! Which point of a capture lies at the origin of the files made of it: for captures whose coordinates f32 cannot hold.

use litetex_exporters::SplatAsset;
use litetex_gs::console::values::numbers;

/// The argument of `--origin`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Origin {
    /// A round point in the middle of the scene.
    Auto,
    /// A point in the capture's frame.
    At([f64; 3]),
}

impl Origin {
    /// Moves the origin of the scene's files and says where it lies.
    pub fn apply(self, asset: &mut SplatAsset) -> String {
        let point = match self {
            Self::Auto => asset.middle_in_capture(),
            Self::At(point) => point,
        };
        asset.set_origin(point);
        let [x, y, z] = point;
        format!("the point {x},{y},{z} of the capture is the origin of the files")
    }
}

/// Parses `auto` or `X,Y,Z`.
pub fn parse_origin(text: &str) -> Result<Origin, String> {
    match text {
        "auto" => Ok(Origin::Auto),
        _ => numbers(text).map(Origin::At).ok_or_else(|| format!("{text:?}: expected auto or X,Y,Z")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_chosen_or_named() {
        assert_eq!(parse_origin("auto"), Ok(Origin::Auto));
        assert_eq!(parse_origin("-1.5, 2,3e6"), Ok(Origin::At([-1.5, 2.0, 3e6])));
        for wrong in ["", "0", "1,2", "1,2,nan", "Auto", "1,2,3,4"] {
            assert!(parse_origin(wrong).is_err(), "{wrong}");
        }
    }
}
