//! Shares as horizontal bars.

use super::escape::escaped_text;
use std::fmt::Write as _;

/// Height of a row, in units of the drawing, as those below.
const ROW: f64 = 24.0;
/// Thickness of a bar.
const BAR: f64 = 14.0;
/// Where bars begin.
const LEFT: f64 = 96.0;
/// Length of the bar of everything.
const LENGTH: f64 = 340.0;

/// Draws shares, 0 to 1, by name; `label` says in words what is drawn.
pub fn bars(label: &str, shares: &[(&str, f64)]) -> String {
    let height = ROW * shares.len() as f64;
    let mut svg =
        format!("<svg viewBox=\"0 0 500 {height}\" role=\"img\" aria-label=\"{}\">", escaped_text(label));
    for (row, (name, share)) in shares.iter().enumerate() {
        let top = ROW * row as f64;
        let _ = write!(
            svg,
            "<text x=\"0\" y=\"{:.0}\">{}</text><rect class=\"bar\" x=\"{LEFT}\" y=\"{:.0}\" width=\"{:.1}\" \
             height=\"{BAR}\"/><text x=\"{:.1}\" y=\"{:.0}\">{:.1} %</text>",
            top + 16.0,
            escaped_text(name),
            top + 4.0,
            LENGTH * share.clamp(0.0, 1.0),
            LEFT + 6.0 + LENGTH * share.clamp(0.0, 1.0),
            top + 16.0,
            100.0 * share
        );
    }
    svg + "</svg>"
}
