//! Draws the series of a chart: error bands, the steps of a Pareto front, lines, markers and their labels, in this
//! order from back to front.

use super::labels::{Rect, Side, along, around, place_labels};
use super::look::{MARK_PX, colour, line_class};
use super::parts::{Area, Chart, Mark, Series};
use super::svg::{Anchor, Svg};

/// Radius of small markers.
const DOT_PX: f64 = 2.6;

/// Draws everything inside the plot's area.
pub fn draw(chart: &Chart, svg: &mut Svg, area: &Area) {
    for s in &chart.series {
        draw_band(s, svg, area);
    }
    // What labels should not cover.
    let mut obstacles = draw_front(chart, svg, area);
    for s in &chart.series {
        let line: Vec<(f64, f64)> = shown(&s.line, area).collect();
        svg.polyline(&line_class(s.look), &line, false);
        obstacles.extend(along(&line));
        obstacles.extend(marks(&s.dots, area).map(|m| around(area.at(m.at), DOT_PX)));
    }
    draw_markers(chart, svg, area);
    draw_labels(chart, svg, area, &obstacles);
}

/// Pixel positions of the points that have one.
fn shown<'a>(points: &'a [(f64, f64)], area: &'a Area) -> impl Iterator<Item = (f64, f64)> + 'a {
    points.iter().filter(|p| area.shows(**p)).map(|p| area.at(*p))
}

fn marks<'a>(all: &'a [Mark], area: &'a Area) -> impl Iterator<Item = &'a Mark> {
    all.iter().filter(|m| area.shows(m.at))
}

fn draw_band(s: &Series, svg: &mut Svg, area: &Area) {
    let bounds: Vec<_> =
        s.band.iter().filter(|(x, low, high)| area.shows((*x, *low)) && area.shows((*x, *high))).collect();
    let upper = bounds.iter().map(|(x, _, high)| area.at((*x, *high)));
    let lower = bounds.iter().rev().map(|(x, low, _)| area.at((*x, *low)));
    let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
    svg.polyline(&format!("lt-band lt-b{}", colour(s.look)), &outline, true);
}

fn draw_front(chart: &Chart, svg: &mut Svg, area: &Area) -> Vec<Rect> {
    let front: Vec<(f64, f64)> = shown(&chart.front, area).collect();
    let mut steps = Vec::new();
    for (i, &(x, y)) in front.iter().enumerate() {
        if i > 0 {
            steps.push((x, front[i - 1].1));
        }
        steps.push((x, y));
    }
    svg.polyline("lt-front", &steps, false);
    along(&steps)
}

/// Grey markers lie below coloured ones, dots below marks.
fn draw_markers(chart: &Chart, svg: &mut Svg, area: &Area) {
    for grey in [true, false] {
        for s in &chart.series {
            let class = if grey { "lt-grey".to_owned() } else { format!("lt-f{}", colour(s.look)) };
            // Without a rim, so that dots on a line do not hide it.
            let dot_class = format!("lt-b{} lt-dot", colour(s.look));
            for dot in marks(&s.dots, area).filter(|m| m.grey == grey) {
                svg.marker(&dot_class, s.look, area.at(dot.at), DOT_PX, &dot.hover);
            }
            for mark in marks(&s.marks, area).filter(|m| m.grey == grey) {
                svg.marker(&class, s.look, area.at(mark.at), MARK_PX, &mark.hover);
            }
        }
    }
}

fn draw_labels(chart: &Chart, svg: &mut Svg, area: &Area, obstacles: &[Rect]) {
    let marks: Vec<&Mark> = chart.series.iter().flat_map(|s| marks(&s.marks, area)).collect();
    let points: Vec<(f64, f64)> = marks.iter().map(|m| area.at(m.at)).collect();
    let texts: Vec<Option<&str>> = marks.iter().map(|m| m.label.as_deref()).collect();
    let bounds = Rect { left: area.left, right: area.right, top: area.top - 4.0, bottom: area.bottom - 2.0 };
    // The steps of a front leave their points to the right.
    let side = if chart.front.is_empty() { Side::Right } else { Side::Left };
    for (place, text) in place_labels(&points, &texts, bounds, obstacles, side).into_iter().zip(&texts) {
        if let (Some(at), Some(text)) = (place, text) {
            svg.text("lt-label", at, Anchor::Start, text, None);
        }
    }
}
