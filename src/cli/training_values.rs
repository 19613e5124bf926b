//! Values of `litetex train` as typed.

use litetex_gs::console::values::parse_colour;
use litetex_gs::model::Filter;
use litetex_gs::train::{Backdrop, Exposure};

/// Reads whether to add a backdrop: "auto" or "none".
pub fn parse_backdrop(text: &str) -> Result<Backdrop, String> {
    match text {
        "auto" => Ok(Backdrop::Auto),
        "none" => Ok(Backdrop::None),
        _ => Err(format!("{text:?}: expected auto or none")),
    }
}

/// Reads a low-pass filter: "none" or "ewa".
pub fn parse_filter(text: &str) -> Result<Filter, String> {
    match text {
        "none" => Ok(Filter::None),
        "ewa" => Ok(Filter::Ewa),
        _ => Err(format!("{text:?}: expected none or ewa")),
    }
}

/// Reads how exposures are treated: "none" or "affine".
pub fn parse_exposure(text: &str) -> Result<Exposure, String> {
    match text {
        "none" => Ok(Exposure::None),
        "affine" => Ok(Exposure::Affine),
        _ => Err(format!("{text:?}: expected none or affine")),
    }
}

/// `--background` of a training run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// This colour, display space.
    Colour([f32; 3]),
    /// Another one in each step.
    Random,
}

impl Background {
    /// Behind rendered images, display space.
    pub fn in_images(self) -> [f32; 3] {
        match self {
            Self::Colour(colour) => colour,
            Self::Random => [0.0; 3],
        }
    }
}

/// Reads a background: "random", or a colour as [`parse_colour`] does.
pub fn parse_background(text: &str) -> Result<Background, String> {
    match text {
        "random" => Ok(Background::Random),
        _ => parse_colour(text)
            .map(Background::Colour)
            .map_err(|wrong| wrong.replace("expected black", "expected random, black")),
    }
}
