//! A chart with two axes: grid, events, series with lines, bands and markers, and a legend next to the plot. Several
//! charts can share a drawing, one below the other with aligned axes.

use super::parts::TOP;
use super::scale::{Scale, labels};
use super::svg::{Anchor, Svg, TEXT_PX, TITLE_PX, shortened, text_width_px};
use super::{legend, series};

pub(super) use super::parts::Area;
pub use super::parts::{Axis, Chart, Mark, Series};
pub use super::scale::{Quantity, Spacing};

/// Size of a chart; it grows with the legend.
const WIDTH_PX: f64 = 760.0;
const HEIGHT_PX: f64 = 400.0;
/// Baselines of the title and of the vertical axis' name, and space below the plot.
const TITLE_Y: f64 = 24.0;
const AXIS_NAME_Y: f64 = 48.0;
const BELOW: f64 = 52.0;
const RIGHT: f64 = 16.0;
/// Horizontal distance of tick labels, at least.
const TICK_GAP_PX: f64 = 14.0;
/// Distance of tick labels from the vertical axis, and the least width left for them.
const TICK_OFFSET_PX: f64 = 8.0;
const LEFT_MIN_PX: f64 = 44.0;
/// Vertical distance of ticks, at least.
const TICK_ROW_PX: f64 = 42.0;
/// Vertical distance of the labels of events.
const EVENT_ROW_PX: f64 = 15.0;

/// Space next to the plot: charts that are stacked have the same.
#[derive(Clone, Copy)]
struct Margins {
    left_px: f64,
    names_px: f64,
}

/// Draws charts one below the other as one SVG file, with aligned plots; `None` if one has nothing to show.
pub fn stacked(charts: &[Chart]) -> Option<String> {
    let all = charts.iter().map(Chart::margins).collect::<Option<Vec<Margins>>>()?;
    let widest = |of: fn(&Margins) -> f64| all.iter().map(of).fold(0.0, f64::max);
    let margins = Margins { left_px: widest(|m| m.left_px), names_px: widest(|m| m.names_px) };
    let drawn = charts.iter().map(|c| c.draw_within(margins)).collect::<Option<Vec<Svg>>>()?;
    Some(Svg::stacked(&drawn).standalone())
}

impl Chart {
    /// Draws the chart; `None` if there is no point to show.
    pub(super) fn draw(&self) -> Option<Svg> {
        self.draw_within(self.margins()?)
    }

    fn draw_within(&self, margins: Margins) -> Option<Svg> {
        let (x, y) = self.scales()?;
        let width = WIDTH_PX + (margins.names_px - legend::NAME_PX).max(0.0);
        let height = self.height_px();
        let mut svg = Svg::new(width, height, &self.describe());
        let area = Area {
            left: margins.left_px,
            right: width - RIGHT - legend::width_px(margins.names_px),
            top: TOP,
            bottom: height - BELOW,
            x,
            y,
        };
        let title = shortened(&self.title, width - 24.0, TITLE_PX * 1.05);
        svg.text("lt-text lt-title", (12.0, TITLE_Y), Anchor::Start, &title, Some(&self.title));
        svg.text("lt-axis", (12.0, AXIS_NAME_Y), Anchor::Start, &self.y.name, None);
        self.draw_y_axis(&mut svg, &area);
        self.draw_x_axis(&mut svg, &area);
        for x in self.shown_events(&area).map(|(x, _)| x) {
            svg.line("lt-event", (x, area.top), (x, area.bottom));
        }
        series::draw(self, &mut svg, &area);
        self.label_events(&mut svg, &area);
        legend::draw(self, &mut svg, area.right);
        Some(svg)
    }

    fn scales(&self) -> Option<(Scale, Scale)> {
        let of = |s: &Series| -> Vec<(f64, f64)> {
            let marks = s.marks.iter().chain(&s.dots).map(|m| m.at);
            let bands = s.band.iter().flat_map(|&(x, low, high)| [(x, low), (x, high)]);
            marks.chain(s.line.iter().copied()).chain(bands).collect()
        };
        let points: Vec<(f64, f64)> = self.series.iter().flat_map(of).collect();
        let x = Scale::around(points.iter().map(|p| p.0), self.x.spacing)?;
        let y = Scale::around(points.iter().map(|p| p.1), self.y.spacing)?;
        Some((x, y))
    }

    fn height_px(&self) -> f64 {
        HEIGHT_PX.max(TOP + legend::height_px(self) + BELOW)
    }

    fn margins(&self) -> Option<Margins> {
        let (_, y) = self.scales()?;
        let (_, labels) = self.y_ticks(&y);
        let widest = labels.iter().map(|l| text_width_px(l, TEXT_PX)).fold(0.0, f64::max);
        let left_px = (widest + TICK_OFFSET_PX + 12.0).max(LEFT_MIN_PX);
        Some(Margins { left_px, names_px: legend::names_px(self) })
    }

    fn y_ticks(&self, y: &Scale) -> (Vec<f64>, Vec<String>) {
        let ticks = y.ticks(((self.height_px() - TOP - BELOW) / TICK_ROW_PX) as usize);
        let labels = labels(&ticks, self.y.quantity);
        (ticks, labels)
    }

    fn draw_y_axis(&self, svg: &mut Svg, area: &Area) {
        let (ticks, labels) = self.y_ticks(&area.y);
        for (tick, label) in ticks.iter().zip(&labels) {
            let (_, y) = area.at((area.x.low, *tick));
            svg.line("lt-grid", (area.left, y), (area.right, y));
            svg.text("lt-axis", (area.left - TICK_OFFSET_PX, y + 4.0), Anchor::End, label, None);
        }
    }

    fn draw_x_axis(&self, svg: &mut Svg, area: &Area) {
        let (ticks, labels) = x_ticks(area, self.x.quantity);
        for (tick, label) in ticks.iter().zip(&labels) {
            let (x, _) = area.at((*tick, area.y.low));
            svg.line("lt-grid", (x, area.top), (x, area.bottom));
            svg.text("lt-axis", (x, area.bottom + 18.0), Anchor::Middle, label, None);
        }
        svg.line("lt-frame", (area.left, area.bottom), (area.right, area.bottom));
        let middle = 0.5 * (area.left + area.right);
        let scale = if self.x.spacing.is_log() { " (log scale)" } else { "" };
        let name = format!("{}{scale}", self.x.name);
        svg.text("lt-axis", (middle, area.bottom + 40.0), Anchor::Middle, &name, None);
    }

    /// Pixel positions and labels of the events.
    fn shown_events<'a>(&'a self, area: &'a Area) -> impl Iterator<Item = (f64, &'a str)> {
        let shown = self.events.iter().filter(|(x, _)| area.shows((*x, area.y.low)));
        shown.map(|(x, text)| (area.at((*x, area.y.low)).0, text.as_str()))
    }

    /// Each label has a row of its own, since events may be close together.
    fn label_events(&self, svg: &mut Svg, area: &Area) {
        let labelled = self.shown_events(area).filter(|(_, text)| !text.is_empty());
        for (row, (x, text)) in labelled.enumerate() {
            let fits_right = x + 6.0 + text_width_px(text, TEXT_PX) <= area.right;
            let (anchor, offset) = if fits_right { (Anchor::Start, 6.0) } else { (Anchor::End, -6.0) };
            let y = area.top + EVENT_ROW_PX * (row as f64 + 1.0);
            svg.text("lt-label", (x + offset, y), anchor, text, None);
        }
    }

    /// Text alternative for readers who do not see the chart.
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
        let axis = |spacing| Axis { name: "seconds <s>".to_owned(), spacing, quantity: Quantity::Plain };
        Chart {
            id: "a".to_owned(),
            title: "A & B".to_owned(),
            x: axis(Spacing::Log10),
            y: axis(Spacing::Linear),
            series,
            front: vec![],
            events: vec![],
        }
    }

    fn mark(x: f64, y: f64) -> Mark {
        Mark { at: (x, y), hover: format!("at {x}, {y}"), label: None, grey: false }
    }

    #[test]
    fn values_without_a_position_are_left_out() {
        let nothing = [(f64::NAN, 1.0), (1.0, f64::INFINITY), (0.0, 1.0), (-3.0, 1.0)];
        let bad: Vec<Mark> = nothing.iter().map(|&(x, y)| mark(x, y)).collect();
        assert!(chart(vec![]).draw().is_none());
        let only_bad = chart(vec![Series { marks: bad[..1].to_vec(), ..Series::default() }]);
        assert!(only_bad.draw().is_none());
        let mut marks = bad;
        marks.extend([mark(2.0, 20.0), mark(50.0, 26.0)]);
        let series = Series { name: "v<1>".to_owned(), line: nothing.to_vec(), marks, ..Series::default() };
        let mut chart = chart(vec![series]);
        chart.events = vec![(-1.0, "never".to_owned()), (7.0, "half <way>".to_owned())];
        let file = chart.draw().unwrap().standalone();
        assert!(file.contains("<title>at 50, 26</title>") && file.contains("v&lt;1&gt;"), "{file}");
        assert!(!file.contains("NaN") && !file.contains("inf"), "{file}");
        assert!(!file.contains("at 0, 1") && !file.contains("never"), "{file}");
        assert!(file.contains("(log scale)") && file.contains("half &lt;way&gt;"), "{file}");
    }

    #[test]
    fn legends_distinguish_long_names_that_differ_late() {
        let names =
            ["0.8", "0.9"].map(|end| format!("density.quantile and all the rest of the settings at {end}"));
        let series =
            |name: &String| Series { name: name.clone(), marks: vec![mark(2.0, 20.0)], ..Series::default() };
        let file = chart(names.iter().map(series).collect()).draw().unwrap().standalone();
        // The legend shows beginning and end, hovering the whole name.
        for (name, end) in names.iter().zip(["0.8", "0.9"]) {
            assert!(
                file.contains(&format!("<title>{name}</title>"))
                    && file.contains(&format!("at {end}</text>"))
            );
        }
    }

    #[test]
    fn stacked_charts_share_a_drawing_and_their_horizontal_axis() {
        let named = |name: &str, high: f64| {
            let line = vec![(1.0, 2.0), (100.0, high)];
            chart(vec![Series { name: name.to_owned(), line, ..Series::default() }])
        };
        let [narrow, wide] = [named("a", 3.0), named("a much longer name of a series", 3e7)];
        let frame = |svg: &str| -> Vec<String> {
            let lines = svg.lines().filter(|l| l.contains("class=\"lt-frame\""));
            let x = |l: &str, key: &str| l.split(key).nth(1).unwrap().split('"').next().unwrap().to_owned();
            lines.map(|l| format!("{} {}", x(l, "x1=\""), x(l, "x2=\""))).collect()
        };
        let file = stacked(&[narrow.clone(), wide.clone()]).unwrap();
        let both = frame(&file);
        assert!(file.matches("<svg").count() == 1 && both.len() == 2 && both[0] == both[1], "{both:?}");
        // Negative control: on their own their plots have different sides.
        let alone = [narrow, wide].map(|c| frame(&c.draw().unwrap().standalone()));
        assert_ne!(alone[0], alone[1]);
        assert!(stacked(&[chart(vec![])]).is_none());
    }

    #[test]
    fn tick_labels_do_not_touch() {
        for (low, high) in [(1.0, 9.0e6), (9.7e3, 1.04e4), (0.001, 0.9), (123_456.0, 654_321.0)] {
            for quantity in [Quantity::Plain, Quantity::Count, Quantity::Bytes] {
                for spacing in [Spacing::Linear, Spacing::Log10, Spacing::Log2] {
                    let x = Scale { low, high, spacing };
                    let y = Scale { low: 0.0, high: 1.0, spacing: Spacing::Linear };
                    let area = Area { left: 50.0, right: 400.0, top: 0.0, bottom: 1.0, x, y };
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
