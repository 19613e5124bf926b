//! What a chart is made of, and where its plot lies.

use super::scale::{Quantity, Scale, Spacing};

/// Top of the plot.
pub const TOP: f64 = 60.0;

/// An axis of a chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name and unit.
    pub name: String,
    /// Linear or logarithmic.
    pub spacing: Spacing,
    /// How tick labels are formatted.
    pub quantity: Quantity,
}

/// A point with a marker.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Position in data units.
    pub at: (f64, f64),
    /// Text shown on hovering.
    pub hover: String,
    /// Text next to the point, where there is room.
    pub label: Option<String>,
    /// Whether to draw it in grey instead of the series' colour.
    pub grey: bool,
}

/// What shares a colour and a marker.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend; no entry if empty.
    pub name: String,
    /// Selects colour, marker and dashes.
    pub look: usize,
    /// Points to connect, in data units.
    pub line: Vec<(f64, f64)>,
    /// Error band as (x, lower, upper).
    pub band: Vec<(f64, f64, f64)>,
    /// Large markers, such as means.
    pub marks: Vec<Mark>,
    /// Small markers, such as single runs.
    pub dots: Vec<Mark>,
}

/// What a chart shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// File name without extension.
    pub id: String,
    /// Title above the chart.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Series in the order of the legend.
    pub series: Vec<Series>,
    /// Points of a Pareto front, drawn as steps.
    pub front: Vec<(f64, f64)>,
    /// Vertical lines at values of x, with labels that may be empty.
    pub events: Vec<(f64, String)>,
}

/// The plot's rectangle in pixels and its scales.
pub struct Area {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
    pub x: Scale,
    pub y: Scale,
}

impl Area {
    /// Pixel position of a point.
    pub fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            self.left + self.x.place(x) * (self.right - self.left),
            self.bottom - self.y.place(y) * (self.bottom - self.top),
        )
    }

    /// Whether a point has a position: finite, and positive on logarithmic axes.
    pub fn shows(&self, (x, y): (f64, f64)) -> bool {
        x.is_finite() && y.is_finite() && self.x.accepts(x) && self.y.accepts(y)
    }
}
