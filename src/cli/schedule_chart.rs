//! A schedule as a chart: scales above, the cap of the textures below, over the steps. SVG by hand; it
//! needs no fonts or scripts beyond what every browser has.

use super::schedule_report::ScheduleReport;
use super::values::format_count;
use litetex_gs::train::StageSpan;
use std::fmt::Write as _;

/// Image and panels, in units of the image. `(left, right)`, `(top, bottom)`
const SIZE: (f64, f64) = (900.0, 560.0);
const ACROSS: (f64, f64) = (70.0, 860.0);
const SCALES: (f64, f64) = (80.0, 320.0);
const CAPS: (f64, f64) = (375.0, 505.0);

/// Colour-blind safe (Okabe and Ito).
const CONTINUOUS: &str = "#0072b2";
const RENDERED: &str = "#d55e00";
const CAP: &str = "#009e73";

/// The chart.
pub fn svg(plan: &ScheduleReport) -> String {
    let mut out = String::new();
    let draw = Chart { out: &mut out, steps: f64::from(plan.steps) };
    // Writing to a string does not fail.
    let _ = draw.all(plan);
    out
}

struct Chart<'a> {
    out: &'a mut String,
    steps: f64,
}

impl Chart<'_> {
    fn all(mut self, plan: &ScheduleReport) -> std::fmt::Result {
        let (width, height) = SIZE;
        writeln!(
            self.out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>"
        )?;
        let name = plan.capture.file_name().unwrap_or(plan.capture.as_os_str()).to_string_lossy();
        let title = format!("Frequency schedule of {}", escaped(&name));
        self.text((ACROSS.0, 28.0), "font-size=\"17\" font-weight=\"bold\"", &title)?;
        let facts = format!(
            "{} views analysed at {}x{} px; pixel work {:.0} % of full size throughout",
            plan.schedule.views,
            plan.width_px,
            plan.height_px,
            100.0 * plan.pixel_work
        );
        self.text((ACROSS.0, 48.0), "fill=\"#666\"", &facts)?;
        self.scales(plan)?;
        self.caps(&plan.stages)?;
        // Below each other: both may be at one step.
        self.event(plan.densify_until, SCALES.1 + 17.0, "densification ends")?;
        self.event(plan.schedule_steps, SCALES.1 + 32.0, "full size from here")?;
        self.out.push_str("</svg>\n");
        Ok(())
    }

    /// s(t) and the render scale.
    fn scales(&mut self, plan: &ScheduleReport) -> std::fmt::Result {
        // One unit of room above the first scale, so that its line does not lie on the frame.
        let highest = plan.schedule.s_max.ceil().max(2.0) + 0.25;
        let y = |scale: f64| along(SCALES, 1.0 - (scale - 0.75) / (highest - 0.75));
        let ticks: Vec<(f64, String)> =
            (1..=highest as u32).map(|s| (y(f64::from(s)), s.to_string())).collect();
        self.panel(SCALES, "scale (full size = 1)", &ticks)?;
        let points: Vec<(f64, f64)> = (0..=600)
            .map(|i| {
                let step = self.steps * f64::from(i) / 600.0;
                (self.x(step), y(plan.schedule.scale(step / f64::from(plan.schedule_steps))))
            })
            .collect();
        let rendered = self.staircase(&plan.stages, |stage| y(stage.render_scale));
        // The wider line below, so that both are seen where they are one.
        self.line(&rendered, RENDERED, 4.0)?;
        self.line(&points, CONTINUOUS, 1.6)?;
        let labels = [(CONTINUOUS, "what the photos ask for, s"), (RENDERED, "what is rendered, r")];
        self.legend(SCALES.0 + 20.0, &labels)
    }

    /// The cap of the texture resolution, on a logarithmic axis.
    fn caps(&mut self, stages: &[StageSpan]) -> std::fmt::Result {
        // From 4 to 256, with a little room.
        let y = |cap: f64| along(CAPS, 1.0 - (cap.log2() - 1.5) / 7.0);
        let ticks: Vec<(f64, String)> = [4, 16, 64, 256].map(|cap| (y(cap.into()), cap.to_string())).into();
        self.panel(CAPS, "texture cap (texels per side)", &ticks)?;
        let line = self.staircase(stages, |stage| y(stage.texture_cap.into()));
        self.line(&line, CAP, 2.5)?;
        for (at, label) in self.step_ticks() {
            let x = self.x(at);
            self.text((x, CAPS.1 + 18.0), "text-anchor=\"middle\"", &label)?;
        }
        self.text(((ACROSS.0 + ACROSS.1) / 2.0, CAPS.1 + 40.0), "text-anchor=\"middle\"", "training step")
    }

    /// Frame, grid, labels of the values and a heading.
    fn panel(&mut self, down: (f64, f64), heading: &str, ticks: &[(f64, String)]) -> std::fmt::Result {
        let (left, right) = ACROSS;
        for (y, label) in ticks {
            writeln!(self.out, "<path d=\"M{left} {y:.1}H{right}\" stroke=\"#e4e4e4\"/>")?;
            self.text((left - 8.0, y + 4.5), "text-anchor=\"end\"", label)?;
        }
        for (step, _) in self.step_ticks() {
            let x = self.x(step);
            writeln!(self.out, "<path d=\"M{x:.1} {}V{}\" stroke=\"#e4e4e4\"/>", down.0, down.1)?;
        }
        let (width, height) = (right - left, down.1 - down.0);
        writeln!(
            self.out,
            "<rect x=\"{left}\" y=\"{}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#888\"/>",
            down.0
        )?;
        self.text((left, down.0 - 8.0), "fill=\"#444\"", heading)
    }

    /// A line across both panels, with its meaning between them at a height.
    fn event(&mut self, step: u32, y: f64, meaning: &str) -> std::fmt::Result {
        let x = self.x(step.into());
        // Room for some words to the right, else to the left.
        let (anchor, offset) = if x < ACROSS.1 - 100.0 { ("start", 6.0) } else { ("end", -6.0) };
        writeln!(
            self.out,
            "<path d=\"M{x:.1} {}V{}\" stroke=\"#888\" stroke-dasharray=\"5 4\"/>",
            SCALES.0, CAPS.1
        )?;
        self.text((x + offset, y), &format!("fill=\"#666\" text-anchor=\"{anchor}\""), meaning)
    }

    fn legend(&mut self, first: f64, labels: &[(&str, &str)]) -> std::fmt::Result {
        for (i, (colour, label)) in labels.iter().enumerate() {
            let y = first + 22.0 * i as f64;
            let x = ACROSS.1 - 250.0;
            writeln!(self.out, "<path d=\"M{x} {y}h26\" stroke=\"{colour}\" stroke-width=\"3\"/>")?;
            self.text((x + 34.0, y + 4.5), "", label)?;
        }
        Ok(())
    }

    /// Level over the steps of each stage.
    fn staircase(&self, stages: &[StageSpan], y: impl Fn(&StageSpan) -> f64) -> Vec<(f64, f64)> {
        let ends = |s: &StageSpan| [f64::from(s.first_step - 1), f64::from(s.last_step)];
        stages.iter().flat_map(|s| ends(s).map(|step| (self.x(step), y(s)))).collect()
    }

    fn line(&mut self, points: &[(f64, f64)], colour: &str, width: f64) -> std::fmt::Result {
        write!(
            self.out,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" points=\""
        )?;
        for (x, y) in points {
            write!(self.out, "{x:.1},{y:.1} ")?;
        }
        writeln!(self.out, "\"/>")
    }

    fn text(&mut self, (x, y): (f64, f64), attributes: &str, text: &str) -> std::fmt::Result {
        writeln!(self.out, "<text x=\"{x:.1}\" y=\"{y:.1}\" {attributes}>{text}</text>")
    }

    fn x(&self, step: f64) -> f64 {
        along(ACROSS, step / self.steps)
    }

    /// Round numbers, about six of them.
    fn step_ticks(&self) -> Vec<(f64, String)> {
        let rough = (self.steps / 6.0).max(1.0);
        let decade = 10.0_f64.powf(rough.log10().floor());
        let distance = [1.0, 2.0, 5.0, 10.0].map(|m| m * decade).into_iter().find(|&d| d >= rough);
        let distance = distance.unwrap_or(rough);
        (0..)
            .map(|i| f64::from(i) * distance)
            .take_while(|&s| s <= self.steps)
            .map(|s| (s, format_count(s as u64)))
            .collect()
    }
}

/// The position at a part of a range.
fn along(range: (f64, f64), part: f64) -> f64 {
    range.0 + (range.1 - range.0) * part
}

/// Text that is no markup, and no control characters, which SVG must not hold.
fn escaped(text: &str) -> String {
    let visible: String = text.chars().filter(|c| !c.is_control()).collect();
    visible.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_no_markup() {
        assert_eq!(escaped("a<b>&\u{7}c"), "a&lt;b&gt;&amp;c");
    }

    #[test]
    fn ticks_are_round_numbers() {
        for (steps, num, last) in
            [(1.0, 2, "1"), (300.0, 7, "300"), (30_000.0, 7, "30,000"), (7_000.0, 4, "6,000")]
        {
            let mut out = String::new();
            let ticks = Chart { out: &mut out, steps }.step_ticks();
            assert_eq!((ticks.len(), ticks[ticks.len() - 1].1.as_str()), (num, last), "{steps}");
        }
    }
}
