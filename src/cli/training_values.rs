//! Values of `litetex train` as typed.

use litetex_gs::console::values::parse_colour;

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

/// How the page of a training is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// In the browser, on any free port.
    Open,
    /// By its address, on any free port.
    Address,
    /// By its address, on this port.
    Port(u16),
}

/// Reads how a page is shown: "open", "no-open" or a port.
pub fn parse_view(text: &str) -> Result<View, String> {
    match (text, text.parse()) {
        ("open", _) => Ok(View::Open),
        ("no-open", _) => Ok(View::Address),
        (_, Ok(port @ 1..)) => Ok(View::Port(port)),
        _ => Err("expected no-open or a port from 1 to 65535".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_and_backgrounds_are_parsed() {
        assert_eq!(["no-open", "8000"].map(parse_view), [Ok(View::Address), Ok(View::Port(8000))]);
        for wrong in ["0", "65536", "yes"] {
            assert!(parse_view(wrong).unwrap_err().contains("a port from 1"), "{wrong}");
        }
        assert_eq!(parse_background("random"), Ok(Background::Random));
        assert_eq!(parse_background("white"), Ok(Background::Colour([1.0; 3])));
        assert!(parse_background("rainbow").unwrap_err().contains("expected random, black"));
    }
}
