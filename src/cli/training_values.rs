//! Values of `litetex train` as typed.

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
    fn pages_are_parsed() {
        assert_eq!(["no-open", "8000"].map(parse_view), [Ok(View::Address), Ok(View::Port(8000))]);
        for wrong in ["0", "65536", "yes"] {
            assert!(parse_view(wrong).unwrap_err().contains("a port from 1"), "{wrong}");
        }
    }
}
