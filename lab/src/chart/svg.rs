//! The SVG writer of all charts: elements, escaping, the style sheet for light and dark screens, widths of text.

use super::look::{DASHES, PALETTE, marker_path};
use std::fmt::Write;

/// Colours of the background, text, secondary text, grid and grey markers, each for light and dark screens.
pub const BACKGROUND: (&str, &str) = ("#ffffff", "#15181c");
const TEXT: (&str, &str) = ("#1c2024", "#e8eaed");
const SECONDARY: (&str, &str) = ("#5c6570", "#a3abb5");
const GRID: (&str, &str) = ("#e4e7eb", "#2b3037");
const GREYED: (&str, &str) = ("#b4bac2", "#59616b");
/// Cells of checks that pass and fail.
const PASS: (&str, &str) = ("#bfe6cf", "#14532f");
const FAIL: (&str, &str) = ("#f6c3cb", "#6b1526");

/// Font sizes of ticks and legends, and of titles.
pub const TEXT_PX: f64 = 12.0;
pub const TITLE_PX: f64 = 15.0;

/// CSS rules for the classes that charts use, the same in files and in pages.
pub fn style() -> String {
    let rules = |dark: bool| {
        let of = |(light, night): (&'static str, &'static str)| if dark { night } else { light };
        let mut css = format!(
            ".lt-bg{{fill:{bg}}}.lt-text{{fill:{text}}}.lt-axis{{fill:{second}}}.lt-grid{{stroke:{grid}}}\
             .lt-frame,.lt-event{{stroke:{second}}}.lt-label{{fill:{text};stroke:{bg}}}\
             .lt-pass{{fill:{pass}}}.lt-fail{{fill:{fail}}}.lt-unknown{{fill:{grid}}}.lt-shown{{fill:none}}\
             .lt-grey{{fill:{grey};stroke:{bg}}}.lt-grey-line{{stroke:{grey}}}.lt-front{{stroke:{text}}}",
            bg = of(BACKGROUND),
            text = of(TEXT),
            second = of(SECONDARY),
            grid = of(GRID),
            grey = of(GREYED),
            pass = of(PASS),
            fail = of(FAIL)
        );
        for (i, &colour) in PALETTE.iter().enumerate() {
            let (c, bg) = (of(colour), of(BACKGROUND));
            // A rim in the background's colour separates overlapping markers.
            let _ = write!(css, ".lt-s{i}{{stroke:{c}}}.lt-f{i}{{fill:{c};stroke:{bg}}}.lt-b{i}{{fill:{c}}}");
        }
        css
    };
    let dashes = DASHES.iter().enumerate().map(|(i, d)| format!(".lt-d{i}{{stroke-dasharray:{d}}}"));
    format!(
        ".lt-chart text{{font:{TEXT_PX}px system-ui,-apple-system,\"Segoe UI\",Roboto,\"Helvetica Neue\",Arial,sans-serif}}\
         .lt-chart .lt-title{{font-size:{TITLE_PX}px;font-weight:600}}\
         .lt-grid,.lt-frame{{stroke-width:1;fill:none}}.lt-line{{stroke-width:2;fill:none;stroke-linejoin:round}}\
         .lt-front{{stroke-width:1.5;fill:none;stroke-dasharray:5 4}}.lt-grey-line{{stroke-width:1.5;fill:none}}\
         .lt-event{{stroke-width:1;stroke-dasharray:5 4}}\
         .lt-band{{opacity:.16}}.lt-dot{{opacity:.5}}.lt-hit{{fill:transparent}}\
         .lt-label{{paint-order:stroke;stroke-width:3px;stroke-linejoin:round}}\
         {}{}@media (prefers-color-scheme:dark){{{}}}",
        dashes.collect::<String>(),
        rules(false),
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

/// Estimated width of a text, on the wide side since the font is the reader's.
pub fn text_width_px(text: &str, size_px: f64) -> f64 {
    let width = |c: char| match c {
        'i' | 'j' | 'l' | 't' | 'f' | 'r' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' | '(' | ')'
        | ' ' => 0.34,
        'm' | 'w' | 'M' | 'W' | '@' | '%' => 0.92,
        'A'..='Z' => 0.70,
        '\u{2e80}'.. => 1.05,
        _ => 0.58,
    };
    text.chars().map(width).sum::<f64>() * size_px
}

/// Shortens a text to a width. An ellipsis replaces the middle, since names differ at their beginnings or ends.
pub fn shortened(text: &str, width_px: f64, size_px: f64) -> String {
    if text_width_px(text, size_px) <= width_px {
        return text.to_owned();
    }
    let chars: Vec<char> = text.chars().collect();
    let mut room = width_px - text_width_px("…", size_px);
    let (mut head, mut tail) = (0, chars.len());
    while head < tail {
        let at_head = head <= chars.len() - tail;
        let next = chars[if at_head { head } else { tail - 1 }];
        room -= text_width_px(next.encode_utf8(&mut [0; 4]), size_px);
        if room < 0.0 {
            break;
        }
        if at_head { head += 1 } else { tail -= 1 }
    }
    let [head, tail] = [&chars[..head], &chars[tail..]].map(|part| part.iter().collect::<String>());
    format!("{}…{}", head.trim_end(), tail.trim_start())
}

/// The part of a text that is placed at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// A drawing under construction.
pub struct Svg {
    width_px: f64,
    height_px: f64,
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

    /// Draws connected lines, closed to a polygon on request; the class decides on stroke and fill.
    pub fn polyline(&mut self, class: &str, points: &[(f64, f64)], closed: bool) {
        if points.is_empty() {
            return;
        }
        let mut d = String::new();
        for (i, (x, y)) in points.iter().enumerate() {
            let _ = write!(d, "{}{x:.1} {y:.1}", if i == 0 { "M" } else { "L" });
        }
        let end = if closed { "Z" } else { "" };
        let _ = writeln!(self.body, r#"<path class="{class}" d="{d}{end}"/>"#);
    }

    /// Draws a text; `hover` is shown while the pointer is over it.
    pub fn text(&mut self, class: &str, at: (f64, f64), anchor: Anchor, text: &str, hover: Option<&str>) {
        let title = hover.map_or(String::new(), |h| format!("<title>{}</title>", escape(h)));
        let _ = writeln!(
            self.body,
            r#"<text class="{class}" x="{:.1}" y="{:.1}" text-anchor="{}">{title}{}</text>"#,
            at.0,
            at.1,
            anchor.name(),
            escape(text)
        );
    }

    /// Draws the marker of series `look`; `hover` is shown while the pointer is near it.
    pub fn marker(&mut self, class: &str, look: usize, at: (f64, f64), radius_px: f64, hover: &str) {
        let d = marker_path(look, at, radius_px);
        let title =
            if hover.is_empty() { String::new() } else { format!("<title>{}</title>", escape(hover)) };
        // A larger invisible disc, since 3 pixels are hard to hit.
        let hit = if hover.is_empty() {
            String::new()
        } else {
            format!(
                r#"<circle class="lt-hit" cx="{:.1}" cy="{:.1}" r="{:.1}"/>"#,
                at.0,
                at.1,
                radius_px + 4.0
            )
        };
        let _ = writeln!(self.body, r#"<g>{title}{hit}<path class="{class}" d="{d}"/></g>"#);
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
        svg.text("a", (0.0, 0.0), Anchor::End, hostile, Some(hostile));
        svg.marker("a", 3, (1.0, 1.0), 2.0, hostile);
        let file = svg.standalone();
        assert!(!file.contains("<script") && !file.contains('\0'), "{file}");
        assert_eq!(file.matches("</svg>").count(), 1);
        assert!(file.contains("&lt;script&gt;alert(&quot;1&quot;)"));
    }

    #[test]
    fn long_names_are_shortened() {
        assert_eq!(shortened("fox", 100.0, 12.0), "fox");
        let short = |name: &str| shortened(name, 90.0, 12.0);
        let long = short("a very long name of a variant");
        assert!(long.starts_with("a ver") && long.ends_with("iant") && long.contains('…'), "{long}");
        assert!(text_width_px(&long, 12.0) <= 90.0, "{long}");
        // Differences survive at the end as at the beginning.
        assert_ne!(short("density.quantile=0.8"), short("density.quantile=0.9"));
        assert_ne!(short("more density.quantile"), short("less density.quantile"));
        assert_eq!(shortened("abc", 1.0, 12.0), "…");
    }
}
