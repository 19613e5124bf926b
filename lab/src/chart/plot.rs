//! A chart: axes, grid, series with lines, bands and markers, and a legend beside them. Knows geometry, not
//! what is measured.

use super::labels::{Rect, Side, along, around, place_labels};
use super::look::{colour, line_class};
use super::scale::{Quantity, Scale, labels};
use super::svg::{Anchor, Svg, TEXT_PX, TITLE_PX, shortened, text_width_px};

/// Size of a chart; higher and wider if the legend needs it.
const WIDTH_PX: f64 = 760.0;
const HEIGHT_PX: f64 = 400.0;
/// Places of title and of the name of the vertical axis (baselines), of the plot, and space below it.
const TITLE_Y: f64 = 24.0;
const AXIS_NAME_Y: f64 = 48.0;
const TOP: f64 = 60.0;
const BELOW: f64 = 52.0;
const RIGHT: f64 = 16.0;
/// Legend: width of names that a chart has room for, and that it is widened for at most; its distance to
/// the plot, width of a line's sample, distance of rows.
const LEGEND_NAME_PX: f64 = 150.0;
const LEGEND_NAME_PX_MAX: f64 = 250.0;
const LEGEND_GAP_PX: f64 = 22.0;
const LEGEND_SAMPLE_PX: f64 = 30.0;
const LEGEND_ROW_PX: f64 = 21.0;
/// Radii of markers: means, single runs.
pub const MARK_PX: f64 = 4.8;
const DOT_PX: f64 = 2.6;
/// Smallest distance of the labels of ticks, and their distance to the axis.
const TICK_GAP_PX: f64 = 14.0;
const TICK_OFFSET_PX: f64 = 8.0;
/// Vertical distance of ticks, at least.
const TICK_ROW_PX: f64 = 42.0;

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name and unit.
    pub name: String,
    /// Whether logarithmic.
    pub log: bool,
    /// What the numbers are.
    pub quantity: Quantity,
}

/// A point that can be hovered over.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Place.
    pub at: (f64, f64),
    /// What is said on hovering.
    pub hover: String,
    /// Written beside it, where there is room.
    pub label: Option<String>,
    /// Greyed out.
    pub grey: bool,
}

/// What shares a colour and a marker.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// Number of colour and marker.
    pub look: usize,
    /// Connected points.
    pub line: Vec<(f64, f64)>,
    /// Place, lower and upper bound.
    pub band: Vec<(f64, f64, f64)>,
    /// Means.
    pub marks: Vec<Mark>,
    /// Single runs.
    pub dots: Vec<Mark>,
}

/// A chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// File name without its ending.
    pub id: String,
    /// Title.
    pub title: String,
    /// Horizontal.
    pub x: Axis,
    /// Vertical.
    pub y: Axis,
    /// In the order of the legend.
    pub series: Vec<Series>,
    /// The points of a front, drawn as steps.
    pub front: Vec<(f64, f64)>,
}

/// The plot's rectangle and its scales.
struct Area {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x: Scale,
    y: Scale,
}

impl Area {
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (
            self.left + self.x.place(x) * (self.right - self.left),
            self.bottom - self.y.place(y) * (self.bottom - self.top),
        )
    }
}

impl Chart {
    /// Draws; `None` if there is nothing to see.
    pub fn draw(&self) -> Option<Svg> {
        let of = |s: &Series| -> Vec<(f64, f64)> {
            let marks = s.marks.iter().chain(&s.dots).map(|m| m.at);
            let bands = s.band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]);
            marks.chain(s.line.iter().copied()).chain(bands).collect()
        };
        let points: Vec<(f64, f64)> = self.series.iter().flat_map(of).collect();
        let x = Scale::around(points.iter().map(|p| p.0), self.x.log)?;
        let y = Scale::around(points.iter().map(|p| p.1), self.y.log)?;
        let names_px = self.legend_names_px();
        let width = WIDTH_PX + (names_px - LEGEND_NAME_PX).max(0.0);
        let rows_px = LEGEND_ROW_PX * (self.legend_rows() as f64 + 1.0);
        let height = HEIGHT_PX.max(TOP + rows_px + BELOW);
        let mut svg = Svg::new(width, height, &self.describe());
        let rows = ((height - TOP - BELOW) / TICK_ROW_PX) as usize;
        let y_ticks = y.ticks(rows);
        let y_labels = labels(&y_ticks, self.y.quantity);
        let widest = y_labels.iter().map(|l| text_width_px(l, TEXT_PX)).fold(0.0, f64::max);
        let area = Area {
            left: (widest + TICK_OFFSET_PX + 12.0).max(44.0),
            right: width - RIGHT - (LEGEND_GAP_PX + LEGEND_SAMPLE_PX + 6.0 + names_px),
            top: TOP,
            bottom: height - BELOW,
            x,
            y,
        };
        let title = shortened(&self.title, width - 24.0, TITLE_PX * 1.05);
        svg.text("lt-text lt-title", (12.0, TITLE_Y), Anchor::Start, &title, Some(&self.title));
        svg.text("lt-axis", (12.0, AXIS_NAME_Y), Anchor::Start, &self.y.name, None);
        for (tick, label) in y_ticks.iter().zip(&y_labels) {
            let (_, py) = area.at((area.x.low, *tick));
            svg.line("lt-grid", (area.left, py), (area.right, py));
            svg.text("lt-axis", (area.left - TICK_OFFSET_PX, py + 4.0), Anchor::End, label, None);
        }
        self.draw_x_axis(&mut svg, &area);
        self.draw_series(&mut svg, &area);
        self.draw_legend(&mut svg, area.right + LEGEND_GAP_PX);
        Some(svg)
    }

    fn draw_x_axis(&self, svg: &mut Svg, area: &Area) {
        let (ticks, labels) = x_ticks(area, self.x.quantity);
        for (tick, label) in ticks.iter().zip(&labels) {
            let (px, _) = area.at((*tick, area.y.low));
            svg.line("lt-grid", (px, area.top), (px, area.bottom));
            svg.text("lt-axis", (px, area.bottom + 18.0), Anchor::Middle, label, None);
        }
        svg.line("lt-frame", (area.left, area.bottom), (area.right, area.bottom));
        let middle = 0.5 * (area.left + area.right);
        let scale = if self.x.log { " (log scale)" } else { "" };
        svg.text(
            "lt-axis",
            (middle, area.bottom + 40.0),
            Anchor::Middle,
            &format!("{}{scale}", self.x.name),
            None,
        );
    }

    fn draw_series(&self, svg: &mut Svg, area: &Area) {
        let usable = |&(x, y): &(f64, f64)| {
            x.is_finite() && y.is_finite() && (!area.x.log || x > 0.0) && (!area.y.log || y > 0.0)
        };
        let drawn = |m: &&Mark| usable(&m.at);
        for s in &self.series {
            let bounds = s.band.iter().filter(|(x, low, high)| usable(&(*x, *low)) && usable(&(*x, *high)));
            let bounds: Vec<_> = bounds.collect();
            let upper = bounds.iter().map(|(x, _, high)| area.at((*x, *high)));
            let lower = bounds.iter().rev().map(|(x, low, _)| area.at((*x, *low)));
            let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
            svg.polyline(&format!("lt-band lt-b{}", colour(s.look)), &outline, true);
        }
        let front: Vec<(f64, f64)> = self.front.iter().filter(|p| usable(p)).map(|p| area.at(*p)).collect();
        let mut steps = Vec::new();
        for (i, &(x, y)) in front.iter().enumerate() {
            if i > 0 {
                steps.push((x, front[i - 1].1));
            }
            steps.push((x, y));
        }
        svg.polyline("lt-front", &steps, false);
        let mut drawn_over = along(&steps);
        for s in &self.series {
            let line: Vec<(f64, f64)> = s.line.iter().filter(|p| usable(p)).map(|p| area.at(*p)).collect();
            svg.polyline(&line_class(s.look), &line, false);
            drawn_over.extend(along(&line));
            drawn_over.extend(s.dots.iter().filter(drawn).map(|m| around(area.at(m.at), DOT_PX)));
        }
        // What is greyed out lies below, means above single runs.
        for grey in [true, false] {
            for s in &self.series {
                let class = if grey { "lt-grey".to_owned() } else { format!("lt-f{}", colour(s.look)) };
                // No rim: a row of them on a line is the line.
                let small = format!("lt-b{} lt-dot", colour(s.look));
                for dot in s.dots.iter().filter(drawn).filter(|m| m.grey == grey) {
                    svg.marker(&small, s.look, area.at(dot.at), DOT_PX, &dot.hover);
                }
                for mark in s.marks.iter().filter(drawn).filter(|m| m.grey == grey) {
                    svg.marker(&class, s.look, area.at(mark.at), MARK_PX, &mark.hover);
                }
            }
        }
        let marks: Vec<&Mark> = self.series.iter().flat_map(|s| &s.marks).filter(drawn).collect();
        let points: Vec<(f64, f64)> = marks.iter().map(|m| area.at(m.at)).collect();
        let texts: Vec<Option<&str>> = marks.iter().map(|m| m.label.as_deref()).collect();
        let bounds =
            Rect { left: area.left, right: area.right, top: area.top - 4.0, bottom: area.bottom - 2.0 };
        // The steps of a front leave their points to the right.
        let first = if self.front.is_empty() { Side::Right } else { Side::Left };
        for (label, text) in place_labels(&points, &texts, bounds, &drawn_over, first).into_iter().zip(&texts)
        {
            if let (Some(at), Some(text)) = (label, text) {
                svg.text("lt-label", at, Anchor::Start, text, None);
            }
        }
    }

    fn draw_legend(&self, svg: &mut Svg, left: f64) {
        let mut y = TOP + 8.0;
        let name_x = left + LEGEND_SAMPLE_PX + 6.0;
        for s in self.series.iter().filter(|s| !s.name.is_empty()) {
            if s.line.len() > 1 {
                svg.line(&line_class(s.look), (left, y), (left + LEGEND_SAMPLE_PX, y));
            }
            let class = format!("lt-f{}", colour(s.look));
            svg.marker(&class, s.look, (left + 0.5 * LEGEND_SAMPLE_PX, y), MARK_PX, "");
            let short = shortened(&s.name, LEGEND_NAME_PX_MAX, TEXT_PX);
            let hover = (short != s.name).then_some(s.name.as_str());
            svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, &short, hover);
            y += LEGEND_ROW_PX;
        }
        if !self.front.is_empty() {
            svg.line("lt-front", (left, y), (left + LEGEND_SAMPLE_PX, y));
            svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, "Pareto front", None);
            y += LEGEND_ROW_PX;
            svg.marker("lt-grey", 0, (left + 0.5 * LEGEND_SAMPLE_PX, y), MARK_PX, "");
            svg.text("lt-text", (name_x, y + 4.0), Anchor::Start, "dominated", None);
        }
    }

    fn legend_rows(&self) -> usize {
        self.series.iter().filter(|s| !s.name.is_empty()).count() + if self.front.is_empty() { 0 } else { 2 }
    }

    fn legend_names_px(&self) -> f64 {
        let names = self.series.iter().map(|s| s.name.as_str());
        let extra = if self.front.is_empty() { "" } else { "Pareto front" };
        let widths = names.chain([extra]).map(|n| text_width_px(n, TEXT_PX));
        widths.fold(0.0, f64::max).min(LEGEND_NAME_PX_MAX)
    }

    /// For those who do not see the chart.
    fn describe(&self) -> String {
        let names: Vec<&str> = self.series.iter().map(|s| s.name.as_str()).collect();
        format!("{}: {} against {}, for {}", self.title, self.y.name, self.x.name, names.join(", "))
    }
}

/// As many ticks as fit with their labels side by side.
fn x_ticks(area: &Area, quantity: Quantity) -> (Vec<f64>, Vec<String>) {
    let mut most = 9;
    loop {
        let ticks = area.x.ticks(most);
        let texts = labels(&ticks, quantity);
        let spans: Vec<(f64, f64)> = ticks
            .iter()
            .zip(&texts)
            .map(|(&tick, text)| {
                let (x, half) = (area.at((tick, area.y.low)).0, 0.5 * text_width_px(text, TEXT_PX));
                (x - half, x + half)
            })
            .collect();
        let fits = spans.windows(2).all(|w| w[0].1 + TICK_GAP_PX <= w[1].0);
        if fits || most <= 2 {
            return (ticks, texts);
        }
        most -= 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: Vec<Series>) -> Chart {
        let axis = |log| Axis { name: "seconds <s>".to_owned(), log, quantity: Quantity::Plain };
        Chart {
            id: "a".to_owned(),
            title: "A & B".to_owned(),
            x: axis(true),
            y: axis(false),
            series,
            front: vec![],
        }
    }

    fn mark(x: f64, y: f64) -> Mark {
        Mark { at: (x, y), hover: format!("at {x}, {y}"), label: None, grey: false }
    }

    #[test]
    fn values_are_in_the_drawing_and_what_is_no_number_is_not() {
        let nothing = [(f64::NAN, 1.0), (1.0, f64::INFINITY), (0.0, 1.0), (-3.0, 1.0)];
        let bad: Vec<Mark> = nothing.iter().map(|&(x, y)| mark(x, y)).collect();
        assert!(chart(vec![]).draw().is_none());
        let only_bad = chart(vec![Series { marks: bad[..1].to_vec(), ..Series::default() }]);
        assert!(only_bad.draw().is_none());
        let mut marks = bad;
        marks.extend([mark(2.0, 20.0), mark(50.0, 26.0)]);
        let series = Series { name: "v<1>".to_owned(), line: nothing.to_vec(), marks, ..Series::default() };
        let file = chart(vec![series]).draw().unwrap().standalone();
        assert!(file.contains("<title>at 50, 26</title>") && file.contains("v&lt;1&gt;"), "{file}");
        assert!(!file.contains("NaN") && !file.contains("inf"), "{file}");
        assert!(!file.contains("at 0, 1"));
        assert!(file.contains("(log scale)"));
    }

    #[test]
    fn legends_tell_apart_what_differs_late_in_long_names() {
        let names =
            ["0.8", "0.9"].map(|end| format!("density.quantile and all the rest of the settings at {end}"));
        let series =
            |name: &String| Series { name: name.clone(), marks: vec![mark(2.0, 20.0)], ..Series::default() };
        let file = chart(names.iter().map(series).collect()).draw().unwrap().standalone();
        // Hovering tells the whole name, the legend the beginning and the end.
        for (name, end) in names.iter().zip(["0.8", "0.9"]) {
            assert!(
                file.contains(&format!("<title>{name}</title>"))
                    && file.contains(&format!("at {end}</text>"))
            );
        }
    }

    #[test]
    fn labels_of_ticks_do_not_touch() {
        for (low, high) in [(1.0, 9.0e6), (9.7e3, 1.04e4), (0.001, 0.9), (123_456.0, 654_321.0)] {
            for quantity in [Quantity::Plain, Quantity::Count, Quantity::Bytes] {
                for log in [true, false] {
                    let x = Scale { low, high, log };
                    let area = Area {
                        left: 50.0,
                        right: 400.0,
                        top: 0.0,
                        bottom: 1.0,
                        x,
                        y: Scale { low: 0.0, high: 1.0, log: false },
                    };
                    let (ticks, texts) = x_ticks(&area, quantity);
                    assert!(!ticks.is_empty());
                    let ends: Vec<(f64, f64)> = ticks
                        .iter()
                        .zip(&texts)
                        .map(|(&t, text)| (area.at((t, 0.0)).0, 0.5 * text_width_px(text, TEXT_PX)))
                        .collect();
                    assert!(
                        ends.windows(2).all(|w| w[0].0 + w[0].1 < w[1].0 - w[1].1),
                        "{low} {high} {texts:?}"
                    );
                }
            }
        }
    }
}
