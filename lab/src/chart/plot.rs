//! A chart with two axes: grid, events, series with lines, bands, intervals and markers, and a legend below the plot.

use super::scale::{Scale, labels};
use super::svg::{Svg, colour, line_class, text_width_px};

pub use super::scale::Quantity;

const WIDTH_PX: f64 = 760.0;
const PLOT_PX: f64 = 300.0;
/// Height of a row of a plot with named rows.
const ROW_PX: f64 = 24.0;
/// Baselines of the title and of the vertical axis' name, and top of the plot.
const TITLE_Y: f64 = 24.0;
const AXIS_NAME_Y: f64 = 48.0;
const TOP: f64 = 60.0;
const RIGHT: f64 = 20.0;
/// Distance of tick labels from the vertical axis, and the least width left for them.
const TICK_OFFSET_PX: f64 = 8.0;
const TICKS_PX_MIN: f64 = 44.0;
/// Most ticks of an axis.
const TICKS_MAX: usize = 7;
/// Vertical distance of the labels of events and of the rows of the legend.
const EVENT_ROW_PX: f64 = 15.0;
const LEGEND_ROW_PX: f64 = 21.0;
/// Width of a line's specimen in the legend.
const SPECIMEN_PX: f64 = 30.0;
/// Radius of large and of small markers.
const MARK_PX: f64 = 4.8;
const DOT_PX: f64 = 2.6;

/// An axis of a chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// Name and unit.
    pub name: String,
    /// Whether it is logarithmic.
    pub is_log: bool,
    /// How tick labels are formatted.
    pub quantity: Quantity,
    /// Names of 0, -1, -2 ..., which are shown instead of numbers; for vertical axes.
    pub rows: Vec<String>,
}

/// A point with a marker.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mark {
    /// Position in data units.
    pub at: (f64, f64),
    /// Text shown on hovering.
    pub hover: String,
    /// Text next to the point, where there is room.
    pub label: String,
    /// Whether it is small, as for a single run.
    pub is_small: bool,
    /// Ends of a horizontal interval around the point.
    pub interval: Option<(f64, f64)>,
}

/// What shares a colour and a marker.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend; no entry if empty.
    pub name: String,
    /// Selects colour, marker and dashes; grey and dashed without.
    pub look: Option<usize>,
    /// Points to connect, in data units.
    pub line: Vec<(f64, f64)>,
    /// Error band as (x, lower, upper).
    pub band: Vec<(f64, f64, f64)>,
    /// Points with markers.
    pub marks: Vec<Mark>,
}

/// What a chart shows.
#[derive(Clone, Debug, Default, PartialEq)]
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
    /// Vertical lines at values of x, with labels that may be empty.
    pub events: Vec<(f64, String)>,
}

/// Draws charts one below the other as one SVG file; `None` if one has nothing to show.
pub fn stacked(charts: &[Chart]) -> Option<String> {
    let drawn = charts.iter().map(Chart::draw).collect::<Option<Vec<Svg>>>()?;
    Some(Svg::stacked(&drawn).standalone())
}

/// The plot's rectangle in pixels and its scales.
struct Area {
    left: f64,
    right: f64,
    bottom: f64,
    x: Scale,
    y: Scale,
}

impl Area {
    /// Pixel position of a point; `None` for those without one: infinite, or not positive on logarithmic axes.
    fn at(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        let (x, y) = (self.x.place(x), self.y.place(y));
        let at = (self.left + x * (self.right - self.left), self.bottom - y * (self.bottom - TOP));
        (at.0.is_finite() && at.1.is_finite()).then_some(at)
    }

    fn x(&self, x: f64) -> Option<f64> {
        Some(self.at((x, self.y.low))?.0)
    }

    fn line(&self, points: impl IntoIterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
        points.into_iter().filter_map(|p| self.at(p)).collect()
    }
}

impl Chart {
    /// Draws the chart; `None` if there is no point to show.
    pub(super) fn draw(&self) -> Option<Svg> {
        let (x, y) = self.scales()?;
        let rows = &self.y.rows;
        let ticks = match rows.len() {
            0 => y.ticks(TICKS_MAX),
            n => (0..n).map(|row| -(row as f64)).collect(),
        };
        let texts = if rows.is_empty() { labels(&ticks, y.is_log, self.y.quantity) } else { rows.clone() };
        let widest = texts.iter().map(|text| text_width_px(text)).fold(TICKS_PX_MIN, f64::max);
        let plot_px = if rows.is_empty() { PLOT_PX } else { ROW_PX * rows.len() as f64 };
        let area =
            Area { left: widest + TICK_OFFSET_PX, right: WIDTH_PX - RIGHT, bottom: TOP + plot_px, x, y };
        let mut svg = Svg::new(WIDTH_PX, 0.0, &self.describe());
        svg.text("lt-text lt-title", (12.0, TITLE_Y), "start", &self.title);
        svg.text("lt-axis", (12.0, AXIS_NAME_Y), "start", &self.y.name);
        for (tick, text) in ticks.iter().zip(&texts) {
            let (_, y) = area.at((area.x.low, *tick))?;
            svg.line("lt-grid", (area.left, y), (area.right, y));
            svg.text("lt-axis", (area.left - TICK_OFFSET_PX, y + 4.0), "end", text);
        }
        self.draw_x_axis(&mut svg, &area);
        for x in self.events.iter().filter_map(|(x, _)| area.x(*x)) {
            svg.line("lt-event", (x, TOP), (x, area.bottom));
        }
        self.draw_series(&mut svg, &area);
        self.label_events(&mut svg, &area);
        self.draw_legend(&mut svg, area.bottom + 64.0);
        Some(svg)
    }

    fn scales(&self) -> Option<(Scale, Scale)> {
        let of = |s: &Series| -> Vec<(f64, f64)> {
            let ends = |m: &Mark| m.interval.map_or([m.at.0; 2], |(low, high)| [low, high]);
            let marks = s.marks.iter().flat_map(|m| ends(m).map(|x| (x, m.at.1)));
            let bands = s.band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]);
            marks.chain(s.line.iter().copied()).chain(bands).collect()
        };
        let points: Vec<(f64, f64)> = self.series.iter().flat_map(of).collect();
        let x = Scale::around(points.iter().map(|p| p.0), self.x.is_log)?;
        let y = match self.y.rows.len() {
            0 => Scale::around(points.iter().map(|p| p.1), self.y.is_log)?,
            n => Scale { low: 0.5 - n as f64, high: 0.5, is_log: false },
        };
        Some((x, y))
    }

    fn draw_x_axis(&self, svg: &mut Svg, area: &Area) {
        let ticks = area.x.ticks(TICKS_MAX);
        for (tick, text) in ticks.iter().zip(labels(&ticks, area.x.is_log, self.x.quantity)) {
            let Some(x) = area.x(*tick) else { continue };
            svg.line("lt-grid", (x, TOP), (x, area.bottom));
            svg.text("lt-axis", (x, area.bottom + 18.0), "middle", &text);
        }
        svg.line("lt-frame", (area.left, area.bottom), (area.right, area.bottom));
        let scale = if area.x.is_log { " (log scale)" } else { "" };
        let middle = 0.5 * (area.left + area.right);
        svg.text("lt-axis", (middle, area.bottom + 40.0), "middle", &format!("{}{scale}", self.x.name));
    }

    /// Bands lie below lines, lines below markers, labels on top.
    fn draw_series(&self, svg: &mut Svg, area: &Area) {
        for s in &self.series {
            let upper = s.band.iter().map(|&(x, _, high)| (x, high));
            let lower = s.band.iter().rev().map(|&(x, low, _)| (x, low));
            svg.polyline(&format!("lt-band {}", colour(s.look)), &area.line(upper.chain(lower)));
        }
        for s in &self.series {
            let class = line_class(s.look);
            svg.polyline(&class, &area.line(s.line.iter().copied()));
            for (mark, (low, high)) in s.marks.iter().filter_map(|m| Some((m, m.interval?))) {
                svg.polyline(&class, &area.line([(low, mark.at.1), (high, mark.at.1)]));
            }
        }
        let mut taken = Vec::new();
        for s in &self.series {
            for mark in &s.marks {
                let Some(at) = area.at(mark.at) else { continue };
                let (class, radius) = if mark.is_small { ("lt-dot", DOT_PX) } else { ("", MARK_PX) };
                svg.marker(class, s.look, at, radius, &mark.hover);
                taken.push(Rect::new(at.0 - radius, at.0 + radius, at.1 - radius, at.1 + radius));
            }
        }
        for mark in self.series.iter().flat_map(|s| &s.marks).filter(|m| !m.label.is_empty()) {
            let place = area.at(mark.at).and_then(|at| place_label(at, &mark.label, area, &mut taken));
            place.into_iter().for_each(|at| svg.text("lt-label", at, "start", &mark.label));
        }
    }

    /// Each label has a row of its own, since events may be close together.
    fn label_events(&self, svg: &mut Svg, area: &Area) {
        let shown = self.events.iter().filter(|(_, text)| !text.is_empty());
        for (row, (x, text)) in shown.filter_map(|(x, text)| Some((area.x(*x)?, text))).enumerate() {
            let fits_right = x + 6.0 + text_width_px(text) <= area.right;
            let (anchor, offset) = if fits_right { ("start", 6.0) } else { ("end", -6.0) };
            svg.text("lt-label", (x + offset, TOP + EVENT_ROW_PX * (row as f64 + 1.0)), anchor, text);
        }
    }

    /// As many names side by side as fit. The drawing ends below them.
    fn draw_legend(&self, svg: &mut Svg, top: f64) {
        let (mut x, mut y) = (12.0, top);
        for s in self.series.iter().filter(|s| !s.name.is_empty()) {
            let width = SPECIMEN_PX + 6.0 + text_width_px(&s.name);
            if x > 12.0 && x + width > WIDTH_PX {
                (x, y) = (12.0, y + LEGEND_ROW_PX);
            }
            if s.line.len() > 1 || s.marks.iter().any(|m| m.interval.is_some()) {
                svg.line(&line_class(s.look), (x, y), (x + SPECIMEN_PX, y));
            }
            if !s.marks.is_empty() {
                svg.marker("", s.look, (x + 0.5 * SPECIMEN_PX, y), MARK_PX, &s.name);
            }
            svg.text("lt-text", (x + SPECIMEN_PX + 6.0, y + 4.0), "start", &s.name);
            x += width + 18.0;
        }
        svg.height_px = y + LEGEND_ROW_PX;
    }

    /// Text alternative for readers who do not see the chart.
    fn describe(&self) -> String {
        let names: Vec<&str> = self.series.iter().map(|s| s.name.as_str()).collect();
        format!("{}: {} against {}, for {}", self.title, self.y.name, self.x.name, names.join(", "))
    }
}

/// A rectangle in pixels.
#[derive(Clone, Copy)]
struct Rect {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

impl Rect {
    fn new(left: f64, right: f64, top: f64, bottom: f64) -> Self {
        Self { left, right, top, bottom }
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }
}

/// Where the baseline of a label begins: above, below, right or left of its point, over no marker or other label; `None`
/// without room.
fn place_label((x, y): (f64, f64), text: &str, area: &Area, taken: &mut Vec<Rect>) -> Option<(f64, f64)> {
    let width = text_width_px(text);
    let gap = MARK_PX + 4.0;
    let middle = x - 0.5 * width;
    let starts = [(middle, y - gap), (middle, y + gap + 9.0), (x + gap, y + 4.0), (x - gap - width, y + 4.0)];
    let extent = |&(left, base): &(f64, f64)| Rect::new(left, left + width, base - 10.0, base + 3.0);
    let is_free = |start: &(f64, f64)| {
        let rect = extent(start);
        let is_inside = area.left <= rect.left && rect.right <= area.right && rect.bottom <= area.bottom;
        is_inside && TOP - 6.0 <= rect.top && !taken.iter().any(|other| rect.overlaps(other))
    };
    let start = starts.into_iter().find(is_free)?;
    taken.push(extent(&start));
    Some(start)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: Vec<Series>) -> Chart {
        let axis = |is_log| Axis { name: "seconds <s>".to_owned(), is_log, ..Axis::default() };
        let (id, title) = ("a".to_owned(), "A & B".to_owned());
        Chart { id, title, x: axis(true), y: axis(false), series, events: vec![] }
    }

    fn mark(x: f64, y: f64, label: &str) -> Mark {
        let (hover, label) = (format!("at {x}, {y}"), label.to_owned());
        Mark { at: (x, y), hover, label, ..Mark::default() }
    }

    fn marked(marks: Vec<Mark>) -> Chart {
        chart(vec![Series { name: "v<1>".to_owned(), look: Some(0), marks, ..Series::default() }])
    }

    #[test]
    fn values_without_a_position_are_left_out() {
        let nothing = [(f64::NAN, 1.0), (1.0, f64::INFINITY), (0.0, 1.0), (-3.0, 1.0)];
        let mut marks: Vec<Mark> = nothing.iter().map(|&(x, y)| mark(x, y, "")).collect();
        assert!(chart(vec![]).draw().is_none() && marked(marks[..1].to_vec()).draw().is_none());
        marks.extend([mark(2.0, 20.0, ""), mark(50.0, 26.0, "")]);
        let mut chart = marked(marks);
        chart.series[0].line = nothing.to_vec();
        chart.events = vec![(-1.0, "never".to_owned()), (7.0, "half <way>".to_owned())];
        let file = chart.draw().unwrap().standalone();
        assert!(file.contains("<title>at 50, 26</title>") && file.contains("v&lt;1&gt;"), "{file}");
        assert!(!file.contains("NaN") && !file.contains("inf"), "{file}");
        assert!(!file.contains("at 0, 1") && !file.contains("never"), "{file}");
        assert!(file.contains("(log scale)") && file.contains("half &lt;way&gt;"), "{file}");
    }

    #[test]
    fn labels_without_room_are_left_out() {
        let near = |n: u32| (0..n).map(|i| mark(10.0, 20.0 + 0.01 * f64::from(i), "a label")).collect();
        let labels = |n| marked(near(n)).draw().unwrap().standalone().matches("a label</text>").count();
        assert_eq!([1, 2].map(labels), [1, 2]);
        assert!(labels(100) < 60);
    }

    #[test]
    fn rows_have_names_and_intervals() {
        let interval = Some((1.0, 3.0));
        let marks = vec![mark(2.0, 0.0, ""), Mark { interval, ..mark(2.0, -1.0, "") }];
        let mut chart = marked(marks);
        chart.y.rows = ["first", "second"].map(ToOwned::to_owned).into();
        let file = chart.draw().unwrap().standalone();
        assert!(file.contains(">first</text>") && file.contains(">second</text>"), "{file}");
        assert_eq!(file.matches("<polyline class=\"lt-line").count(), 1);
    }
}
