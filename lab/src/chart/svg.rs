//! The SVG writer of all charts: elements, markers, escaping, the style sheet for light and dark screens.

use std::fmt::Write;

/// Colours of the background, text, secondary text, grid and grey markers, each for light and dark screens.
const BACKGROUND: (&str, &str) = ("#ffffff", "#15181c");
const TEXT: (&str, &str) = ("#1c2024", "#e8eaed");
const SECONDARY: (&str, &str) = ("#5c6570", "#a3abb5");
const GRID: (&str, &str) = ("#e4e7eb", "#2b3037");
const GREYED: (&str, &str) = ("#b4bac2", "#59616b");
/// Cells of tables that say that something is good or bad.
const GOOD: (&str, &str) = ("#bfe6cf", "#14532f");
const BAD: (&str, &str) = ("#f6c3cb", "#6b1526");
/// Colours of series on a light and on a dark background. They differ in lightness as well as in hue, and markers
/// differ in shape, for readers who do not distinguish the hues.
const PALETTE: [(&str, &str); 8] = [
    ("#0b62a4", "#5aa9e6"),
    ("#c8500a", "#ff9a55"),
    ("#0a7d55", "#3ecf97"),
    ("#8e3a9d", "#d99be6"),
    ("#8a6d00", "#e3c04a"),
    ("#b0203a", "#ff7a8c"),
    ("#0c7f92", "#52d0e0"),
    ("#4d545c", "#b9c0c9"),
];
/// Dashes and gaps of lines in pixels, one pattern for each round through the colours.
const DASHES: [&str; 4] = ["none", "8 3", "2 3", "9 3 2 3"];
/// Corners of markers, all of about the area of a circle, which has none. Their number has no factor in common with that of
/// the colours, so that forty series differ in one or the other.
const SHAPES: [&[(f64, f64)]; 5] = [
    &[],
    &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
    &[(0.0, -1.25), (1.2, 0.9), (-1.2, 0.9)],
    &[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
    &[(0.0, 1.25), (1.2, -0.9), (-1.2, -0.9)],
];

/// Font sizes of ticks and legends, and of titles.
const TEXT_PX: f64 = 12.0;
const TITLE_PX: f64 = 15.0;
/// Mean width of a character, on the wide side since the font is the reader's.
const CHAR_PX: f64 = 6.8;

/// Estimated width of a text.
pub fn text_width_px(text: &str) -> f64 {
    CHAR_PX * text.chars().count() as f64
}

/// CSS class of a series: its colour, or grey without a number.
pub fn colour(look: Option<usize>) -> String {
    look.map_or("lt-grey".to_owned(), |look| format!("lt-c{}", look % PALETTE.len()))
}

/// CSS classes of a series' line.
pub fn line_class(look: Option<usize>) -> String {
    let dashes = look.map_or(1, |look| look / PALETTE.len() % DASHES.len());
    format!("lt-line {} lt-d{dashes}", colour(look))
}

/// CSS rules for the classes that charts use, the same in files and in pages.
pub fn style() -> String {
    let rules = |dark: bool| {
        let of = |(light, night): (&'static str, &'static str)| if dark { night } else { light };
        let [bg, text, second, grid] = [BACKGROUND, TEXT, SECONDARY, GRID].map(of);
        let mut css = format!(
            ".lt-bg{{fill:{bg}}}.lt-text{{fill:{text}}}.lt-axis{{fill:{second}}}.lt-grid{{stroke:{grid}}}\
             .lt-frame,.lt-event{{stroke:{second}}}.lt-label{{fill:{text};stroke:{bg}}}.lt-mark{{stroke:{bg}}}\
             .lt-good{{fill:{}}}.lt-bad{{fill:{}}}.lt-faint{{fill:{grid}}}",
            of(GOOD),
            of(BAD)
        );
        let classes = (0..PALETTE.len()).map(|i| colour(Some(i))).chain([colour(None)]);
        for (class, pair) in classes.zip(PALETTE.into_iter().chain([GREYED])) {
            // A rim in the background's colour separates overlapping markers.
            let _ = write!(css, ".lt-line.{class}{{stroke:{c}}}.{class}{{fill:{c}}}", c = of(pair));
        }
        css
    };
    let dashes = DASHES.iter().enumerate().map(|(i, d)| format!(".lt-d{i}{{stroke-dasharray:{d}}}"));
    format!(
        "{}{}.lt-chart text{{font:{TEXT_PX}px system-ui,-apple-system,\"Segoe UI\",Roboto,\"Helvetica Neue\",Arial,sans-serif}}\
         .lt-chart .lt-title{{font-size:{TITLE_PX}px;font-weight:600}}\
         .lt-grid,.lt-frame{{stroke-width:1;fill:none}}.lt-chart .lt-line{{stroke-width:2;fill:none;stroke-linejoin:round}}\
         .lt-event{{stroke-width:1;stroke-dasharray:5 4}}\
         .lt-band{{opacity:.16}}.lt-dot{{opacity:.5}}.lt-chart .lt-hit{{fill:transparent}}\
         .lt-label{{paint-order:stroke;stroke-width:3px;stroke-linejoin:round}}\
         @media (prefers-color-scheme:dark){{{}}}",
        rules(false),
        dashes.collect::<String>(),
        rules(true)
    )
}

/// Escapes text for element content and attribute values; characters that XML forbids are dropped or become blanks.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\u{fffe}' | '\u{ffff}' => {}
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// A drawing under construction.
pub struct Svg {
    width_px: f64,
    /// May be set last.
    pub height_px: f64,
    label: String,
    body: String,
}

impl Svg {
    /// An empty drawing; `label` is its text alternative.
    pub fn new(width_px: f64, height_px: f64, label: &str) -> Self {
        Self { width_px, height_px, label: label.to_owned(), body: String::new() }
    }

    /// Draws drawings one below the other, as wide as the widest.
    pub fn stacked(drawings: &[Self]) -> Self {
        let width = drawings.iter().map(|d| d.width_px).fold(0.0, f64::max);
        let label = drawings.iter().map(|d| d.label.as_str()).collect::<Vec<_>>().join("; ");
        let mut all = Self::new(width, 0.0, &label);
        for drawing in drawings {
            let top = all.height_px;
            let _ = write!(all.body, "<g transform=\"translate(0 {top})\">\n{}</g>\n", drawing.body);
            all.height_px += drawing.height_px;
        }
        all
    }

    /// Draws a straight line.
    pub fn line(&mut self, class: &str, from: (f64, f64), to: (f64, f64)) {
        let _ = writeln!(
            self.body,
            r#"<line class="{class}" x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}"/>"#,
            from.0, from.1, to.0, to.1
        );
    }

    /// Draws connected lines; the class decides on stroke and fill.
    pub fn polyline(&mut self, class: &str, points: &[(f64, f64)]) {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        if !points.is_empty() {
            let _ = writeln!(self.body, r#"<polyline class="{class}" points="{}"/>"#, points.join(" "));
        }
    }

    /// Draws a text; `anchor` is the part of it that is placed: "start", "middle", "end".
    pub fn text(&mut self, class: &str, (x, y): (f64, f64), anchor: &str, text: &str) {
        let _ = writeln!(
            self.body,
            r#"<text class="{class}" x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#,
            escape(text)
        );
    }

    /// Draws the marker of a series; `hover` is shown while the pointer is near it.
    pub fn marker(
        &mut self,
        class: &str,
        look: Option<usize>,
        (x, y): (f64, f64),
        radius_px: f64,
        hover: &str,
    ) {
        let class = format!("lt-mark {class} {}", colour(look));
        let corners = SHAPES[look.unwrap_or(0) % SHAPES.len()].iter();
        let points: Vec<String> =
            corners.map(|(dx, dy)| format!("{:.1},{:.1}", x + dx * radius_px, y + dy * radius_px)).collect();
        let shape = if points.is_empty() {
            format!(r#"<circle class="{class}" cx="{x:.1}" cy="{y:.1}" r="{radius_px:.1}"/>"#)
        } else {
            format!(r#"<polygon class="{class}" points="{}"/>"#, points.join(" "))
        };
        // A larger invisible disc, since 3 pixels are hard to hit.
        let hit = radius_px + 4.0;
        let _ = writeln!(
            self.body,
            r#"<g><title>{}</title><circle class="lt-hit" cx="{x:.1}" cy="{y:.1}" r="{hit:.1}"/>{shape}</g>"#,
            escape(hover)
        );
    }

    /// The element for a page that contains [`style`].
    pub fn inline(&self) -> String {
        self.element("", "")
    }

    /// The contents of an SVG file, with its style sheet.
    pub fn standalone(&self) -> String {
        let (w, h) = (self.width_px, self.height_px);
        let head = format!(r#"<style>{}</style><rect class="lt-bg" width="{w}" height="{h}"/>"#, style());
        let size = format!(r#" xmlns="http://www.w3.org/2000/svg" width="{w}" height="{h}""#);
        self.element(&size, &head) + "\n"
    }

    fn element(&self, attributes: &str, head: &str) -> String {
        format!(
            "<svg class=\"lt-chart\"{attributes} viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{head}\n{}</svg>",
            self.width_px,
            self.height_px,
            escape(&self.label),
            self.body
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(colour: &str) -> f64 {
        let channel = |i: usize| {
            let c = f64::from(u8::from_str_radix(&colour[i..i + 2], 16).unwrap()) / 255.0;
            if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
    }

    /// Contrast ratio of the Web Content Accessibility Guidelines.
    fn contrast(a: &str, b: &str) -> f64 {
        let (a, b) = (luminance(a), luminance(b));
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    #[test]
    fn colours_have_contrast_on_light_and_dark_backgrounds() {
        assert!((contrast("#ffffff", "#000000") - 21.0).abs() < 1e-9);
        for (light, dark) in PALETTE.into_iter().chain([TEXT, SECONDARY]) {
            // The guideline's minimum for text; for graphics it is 3.
            assert!(contrast(light, BACKGROUND.0) > 4.5, "{light}");
            assert!(contrast(dark, BACKGROUND.1) > 4.5, "{dark}");
        }
        // Negative control: grey markers are fainter.
        assert!(contrast(GREYED.0, BACKGROUND.0) < 3.0 && contrast(GREYED.1, BACKGROUND.1) < 3.0);
    }

    #[test]
    fn names_with_markup_are_escaped() {
        let hostile = "</svg><script>alert(\"1\")</script>&'\u{0}\u{b}";
        let mut svg = Svg::new(10.0, 10.0, hostile);
        svg.text("a", (0.0, 0.0), "end", hostile);
        svg.marker("a", Some(3), (1.0, 1.0), 2.0, hostile);
        let file = svg.standalone();
        assert!(!file.contains("<script") && !file.contains('\0'), "{file}");
        assert_eq!(file.matches("</svg>").count(), 1);
        assert!(file.contains("&lt;script&gt;alert(&quot;1&quot;)"));
    }

    #[test]
    fn forty_series_differ_in_colour_or_marker() {
        let looks = |n: usize| {
            (0..n).map(|i| (colour(Some(i)), i % SHAPES.len())).collect::<std::collections::HashSet<_>>()
        };
        assert_eq!(looks(40).len(), 40);
        // Negative control: after that they repeat.
        assert_eq!(looks(41).len(), 40);
    }
}
