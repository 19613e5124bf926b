//! The legend next to a chart.

use super::look::{MARK_PX, colour, line_class};
use super::parts::{Chart, Series, TOP};
use super::svg::{Anchor, Svg, TEXT_PX, shortened, text_width_px};

/// Width of names that a chart has room for; it is widened for longer ones.
pub const NAME_PX: f64 = 150.0;
/// Width at which names are shortened.
const NAME_PX_MAX: f64 = 250.0;
/// Distance from the plot, width of a line's specimen, distance between it and the name.
const GAP_PX: f64 = 22.0;
const SPECIMEN_PX: f64 = 30.0;
const NAME_GAP_PX: f64 = 6.0;
const ROW_PX: f64 = 21.0;

/// Width of the longest name, as shown.
pub fn names_px(chart: &Chart) -> f64 {
    let names = chart.series.iter().map(|s| s.name.as_str());
    let extra = if chart.front.is_empty() { "" } else { "Pareto front" };
    let widths = names.chain([extra]).map(|n| text_width_px(n, TEXT_PX));
    widths.fold(0.0, f64::max).min(NAME_PX_MAX)
}

/// Width of a legend with names of this width, including its distance from the plot.
pub fn width_px(names_px: f64) -> f64 {
    GAP_PX + SPECIMEN_PX + NAME_GAP_PX + names_px
}

/// Height of the legend.
pub fn height_px(chart: &Chart) -> f64 {
    let rows = named(chart).count() + if chart.front.is_empty() { 0 } else { 2 };
    ROW_PX * (rows as f64 + 1.0)
}

/// Draws the legend to the right of `plot_right`.
pub fn draw(chart: &Chart, svg: &mut Svg, plot_right: f64) {
    let left = plot_right + GAP_PX;
    let (right, middle) = (left + SPECIMEN_PX, left + 0.5 * SPECIMEN_PX);
    let name_x = right + NAME_GAP_PX;
    let mut y = TOP + 8.0;
    for s in named(chart) {
        if s.line.len() > 1 {
            svg.line(&line_class(s.look), (left, y), (right, y));
        }
        if !(s.marks.is_empty() && s.dots.is_empty()) {
            svg.marker(&format!("lt-f{}", colour(s.look)), s.look, (middle, y), MARK_PX, "");
        }
        let short = shortened(&s.name, NAME_PX_MAX, TEXT_PX);
        let hover = (short != s.name).then_some(s.name.as_str());
        svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, &short, hover);
        y += ROW_PX;
    }
    if !chart.front.is_empty() {
        svg.line("lt-front", (left, y), (right, y));
        svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, "Pareto front", None);
        y += ROW_PX;
        svg.marker("lt-grey", 0, (middle, y), MARK_PX, "");
        svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, "dominated", None);
    }
}

fn named(chart: &Chart) -> impl Iterator<Item = &Series> {
    chart.series.iter().filter(|s| !s.name.is_empty())
}
