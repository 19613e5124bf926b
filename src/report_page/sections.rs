//! The sections beneath the scene.

use super::bars::bars;
use super::coverage::Coverage;
use super::escape::escaped_text as e;
use super::figures::{FileFigures, ReportFigures, WorstView, WorstViews};
use super::picture::Picture;
use crate::capture::{Rating, Reason, Verdict};
use crate::text::{counted, format_bytes};
use std::fmt::Write as _;

/// All sections, in the order in which they are read.
pub fn sections(figures: &ReportFigures) -> String {
    let mut out = String::new();
    if let Some(why) = &figures.no_photos {
        let _ = write!(out, "<section><p class=\"soft\">Without photos: {}.</p></section>", e(why));
    }
    if let Some(views) = &figures.views {
        section(&mut out, "Worst views", &worst_views(views));
    }
    if let Some(verdict) = &figures.verdict {
        section(&mut out, "Capture", &of_verdict(verdict));
    }
    if let Some(coverage) = &figures.coverage {
        section(&mut out, "Coverage", &of_coverage(coverage));
    }
    let drawings = figures.curve.drawings();
    if !drawings.is_empty() {
        section(&mut out, "Training", &format!("<div class=\"curves\">{}</div>", drawings.concat()));
    }
    section(&mut out, "Files", &files(&figures.files));
    section(&mut out, "Settings and results", &pairs(&figures.facts));
    section(&mut out, "Rights", &pairs(&figures.metadata));
    out
}

fn section(out: &mut String, heading: &str, content: &str) {
    let _ = write!(out, "<section><h2>{heading}</h2>{content}</section>");
}

fn worst_views(views: &WorstViews) -> String {
    let kind = if views.are_training { "training" } else { "test" };
    let which = match (views.views.len(), views.of_views) {
        (shown, all) if shown == all => {
            format!("All {}, the worst first", counted(all, &format!("{kind} view")))
        }
        (shown, all) => {
            format!("The {shown} of {} with the lowest PSNR", counted(all, &format!("{kind} view")))
        }
    };
    let mut out = format!(
        "<p>{which}. On average, PSNR is {:.2} dB and gradient-PSNR {:.2} dB.</p>",
        views.psnr, views.grad_psnr
    );
    if views.are_training {
        out += "<p class=\"soft\">The capture has no test views, so these are views that the scene was trained on: they say little of \
                other views.</p>";
    }
    views.views.iter().for_each(|view| out += &worst_view(view));
    out
}

fn worst_view(view: &WorstView) -> String {
    let WorstView { name, psnr, grad_psnr, photo, render, error_map } = view;
    let name = e(name);
    let mut out = format!("<h3>{name}: {psnr:.2} dB, gradient {grad_psnr:.2} dB</h3><div class=\"views\">");
    for (picture, what, caption) in [
        (photo, "Photo", "Photo"),
        (render, "Render", "Render"),
        (error_map, "Error map", "Error: black none, bright yellow 25 % and more"),
    ] {
        let Picture { width_px, height_px, .. } = picture;
        let _ = write!(
            out,
            "<figure><img src=\"{}\" width=\"{width_px}\" height=\"{height_px}\" alt=\"{what} of {name}\">\
             <figcaption>{caption}</figcaption></figure>",
            picture.url()
        );
    }
    out + "</div>"
}

fn of_verdict(verdict: &Verdict) -> String {
    let class = match verdict.rating {
        Rating::Good => "good",
        Rating::Usable => "usable",
        Rating::ShootAgain => "shoot-again",
    };
    let mut out = format!("<p>Verdict: <strong class=\"{class}\">{}</strong></p>", verdict.rating.words());
    if !verdict.reasons.is_empty() {
        out += "<ul>";
        for Reason { found, remedy, .. } in &verdict.reasons {
            let _ = write!(out, "<li>{}: {}</li>", e(found), e(remedy));
        }
        out += "</ul>";
    }
    out
}

fn of_coverage(coverage: &Coverage) -> String {
    let Coverage { views, of_views, splats_by_views, uncovered, most_uncovered } = coverage;
    let which = if views < of_views {
        format!("{views} of the {} (evenly spread)", counted(*of_views, "training view"))
    } else {
        format!("all {}", counted(*of_views, "training view"))
    };
    let label = splats_by_views.iter().map(|(name, share)| format!("{name}: {:.1} %", 100.0 * share));
    let label = format!("Share of the splats shown by: {}", label.collect::<Vec<_>>().join(", "));
    let mut out = format!(
        "<p>Counted in {which}. What only one or two views show is vague from elsewhere; what none shows is hidden or outside of all \
         images.</p>\
         <figure>{}<figcaption>Share of the splats, by the number of views that show them</figcaption></figure><p>Uncovered pixels: \
         {:.2} % on average",
        bars(&label, splats_by_views),
        100.0 * uncovered
    );
    if let Some((name, share)) = most_uncovered.as_ref().filter(|(_, share)| *share > 0.0) {
        let _ = write!(out, ", most in {}: {:.2} %", e(name), 100.0 * share);
    }
    out + ".</p>"
}

fn files(files: &[FileFigures]) -> String {
    let mut out = "<div class=\"scroll\"><table><thead><tr><th scope=\"col\">File</th><th scope=\"col\">Size</th><th scope=\"col\">PSNR to \
                   the trained scene</th><th scope=\"col\">Lost</th><th scope=\"col\">Test PSNR</th></tr></thead><tbody>"
        .to_owned();
    for file in files {
        let psnr = if file.psnr.is_finite() { format!("{:.1} dB", file.psnr) } else { "same".to_owned() };
        let on_tests = file
            .on_test_photos
            .map_or_else(|| "-".to_owned(), |[before, after]| format!("{before:.2} \u{2192} {after:.2} dB"));
        let note = if file.untextured { " (without textures)" } else { "" };
        // Test PSNRs say better than an estimate what is lost with the textures.
        let lost = match file.on_test_photos {
            Some(_) if file.untextured => "textures".to_owned(),
            _ => format!("{:.3} dB", file.loss_db),
        };
        let _ = write!(
            out,
            "<tr><td>{}{note}</td><td>{}</td><td>{psnr}</td><td>{lost}</td><td>{on_tests}</td></tr>",
            e(&file.name),
            format_bytes(file.bytes)
        );
    }
    out + "</tbody></table></div>"
}

fn pairs(pairs: &[(&str, String)]) -> String {
    let rows = pairs
        .iter()
        .map(|(name, value)| format!("<tr><th scope=\"row\">{}</th><td>{}</td></tr>", e(name), e(value)));
    format!("<div class=\"scroll\"><table><tbody>{}</tbody></table></div>", rows.collect::<String>())
}
