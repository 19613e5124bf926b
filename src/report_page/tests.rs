//! The page made of figures: what it says, that texts stay texts, and that it loads nothing.

use super::*;
use crate::backend::RenderedImage;
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::capture::{Rating, Reason, Verdict};
use litetex_exporters::Provenance;
use std::path::Path;

const HOSTILE: &str = "</script><script>alert(1)</script>\"' onerror=\"x\u{202e}";

fn picture() -> Picture {
    Picture::new(4, 3, vec![100; 4 * 3 * 3]).unwrap()
}

fn figures(name: &str) -> ReportFigures {
    let view = WorstView {
        name: name.to_owned(),
        psnr: 20.126,
        grad_psnr: 30.5,
        photo: picture(),
        render: picture(),
        error_map: picture(),
    };
    ReportFigures {
        views: Some(WorstViews {
            are_training: false,
            of_views: 9,
            psnr: 22.0,
            grad_psnr: 31.0,
            views: vec![view],
        }),
        coverage: Some(Coverage {
            views: 60,
            of_views: 200,
            splats_by_views: vec![("no view", 0.25), ("1 view", 0.75)],
            uncovered: 0.015,
            most_uncovered: Some((name.to_owned(), 0.04)),
        }),
        files: vec![FileFigures {
            name: name.to_owned(),
            bytes: 2048,
            psnr: 55.0,
            loss_db: 0.0125,
            untextured: false,
            on_test_photos: Some([22.0, 21.99]),
        }],
        facts: vec![("steps", name.to_owned())],
        metadata: vec![("licence", name.to_owned())],
        no_photos: Some(name.to_owned()),
        ..ReportFigures::default()
    }
}

fn page(figures: &ReportFigures) -> String {
    String::from_utf8(report_html(figures, b"scene", &Provenance::default()).unwrap()).unwrap()
}

/// The part of the page that is no script of the viewer.
fn report(html: &str) -> &str {
    html.split("<main id=\"report\"").nth(1).unwrap().split("</main>").next().unwrap()
}

#[test]
fn figures_are_said_in_words_and_pictures() {
    let html = page(&figures("a.jpg"));
    let report = report(&html);
    for expected in [
        "The 1 of 9 test views with the lowest PSNR",
        "a.jpg: 20.13 dB, gradient 30.50 dB",
        "alt=\"Photo of a.jpg\"",
        "alt=\"Error map of a.jpg\"",
        "Counted in 60 of the 200 training views",
        "Uncovered pixels: 1.50 % on average, most in a.jpg: 4.00 %",
        "<td>2.0 KiB</td><td>55.0 dB</td><td>0.013 dB</td><td>22.00 \u{2192} 21.99 dB</td>",
    ] {
        assert!(report.contains(expected), "{expected}: {report}");
    }
    assert_eq!(report.matches("src=\"data:image/jpeg;base64,").count(), 3);
    assert!(
        !report.contains("Training</h2>") && !report.contains("Verdict"),
        "nothing is said of what is unknown"
    );
    let mut lost = figures("a.jpg");
    lost.files[0].untextured = true;
    assert!(page(&lost).contains("<td>55.0 dB</td><td>textures</td><td>22.00 \u{2192} 21.99 dB</td>"));
    let mut training = figures("a.jpg");
    training.views.as_mut().unwrap().are_training = true;
    assert!(page(&training).contains("The capture has no test views"));
    assert!(!report.contains("The capture has no test views"), "negative control");
}

#[test]
fn verdicts_have_their_reasons() {
    let reason = Reason {
        code: "few-views",
        rating: Rating::ShootAgain,
        found: format!("only 3 views of {HOSTILE}"),
        remedy: "take more",
    };
    let verdict = Verdict { rating: Rating::ShootAgain, reasons: vec![reason], figures: Default::default() };
    let html = page(&ReportFigures { verdict: Some(verdict), ..ReportFigures::default() });
    let report = report(&html);
    assert!(report.contains("<strong class=\"shoot-again\">shoot again</strong>"), "{report}");
    assert!(
        report.contains("only 3 views of &lt;/script&gt;") && report.contains(": take more</li>"),
        "{report}"
    );
}

#[test]
fn texts_stay_texts_and_nothing_is_loaded() {
    let [plain, hostile] = ["a.jpg", HOSTILE].map(|name| page(&figures(name)));
    let tags = |html: &str| html.matches('<').count();
    assert_eq!(tags(report(&plain)), tags(report(&hostile)));
    assert!(!hostile.contains("alert(1)</script>") && !hostile.contains('\u{202e}'));
    assert!(
        report(&hostile).contains("&lt;/script&gt;&lt;script&gt;alert(1)")
            && !report(&hostile).contains(" onerror=\"x")
    );
    for html in [&plain, &hostile] {
        let report = report(html);
        assert!(
            !report.contains("http") && !report.contains("style=") && !report.contains("<script"),
            "{report}"
        );
    }
    // Negative control: unescaped, the name adds elements.
    assert!(tags(&report(&plain).replace("a.jpg", HOSTILE)) > tags(report(&plain)));
    // The policy knows the report's style, and the style stands in the head.
    let head = hostile.split("<body").next().unwrap();
    assert_eq!(head.matches("<style").count(), 2);
    let style = head.split("style-src ").nth(1).unwrap().split(';').next().unwrap();
    assert_eq!(style.matches("sha256-").count(), 2, "{style}");
    let own = Provenance { title: "T".to_owned(), ..Provenance::default() };
    let bytes = report_html(&figures("a.jpg"), b"scene", &own).unwrap();
    let scene = litetex_exporters::html::embedded(&bytes, Path::new("a.html")).unwrap();
    assert_eq!(scene, b"scene", "the report is read as a scene");
}

#[test]
fn curves_are_read_from_metrics() {
    let step = |step: u32, loss: f64| {
        format!(
            "{{\"event\":\"step\",\"step\":{step},\"loss\":{{\"total\":{loss}}},\"train_wall_secs\":{step}.0}}\n"
        )
    };
    let evaluated = |step: u32, psnr: f64| {
        format!(
            "{{\"event\":\"evaluated\",\"step\":{step},\"point\":{{\"psnr_test\":{psnr},\"wall_secs\":{step}.0}}}}\n"
        )
    };
    let mut text = "{\"event\":\"started\",\"step\":0}\n".to_owned();
    (1..=1000).for_each(|i| text += &step(i, 1.0 / f64::from(i)));
    text += &evaluated(500, 20.0);
    text += "{\"event\":\"started\",\"step\":900}\nnot JSON\n";
    text += &step(901, 0.5);
    text += &evaluated(901, 21.0);
    text += "{\"event\":\"step\",\"step\":902,\"lo";
    let curve = TrainingCurve::from_metrics(&text);
    assert_eq!(curve.losses.len(), 901, "the steps that were done again count once");
    assert_eq!(curve.losses.last(), Some(&(901, 901.0, 0.5)));
    assert_eq!(curve.psnrs, [(500, 500.0, 20.0), (901, 901.0, 21.0)]);
    let html = page(&ReportFigures { curve, ..ReportFigures::default() });
    let report = report(&html);
    assert!(report.contains("Test PSNR: 20.00 dB at step 500, 21.00 dB at step 901"), "{report}");
    let line = report.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!((200..=401).contains(&line.split(' ').count()), "long curves lose points");
    assert!(report.contains(">901</text>") && report.contains(">15 min</text>"), "{report}");
    for short in ["", &step(1, 0.5), "[]\n7\n"] {
        assert!(TrainingCurve::from_metrics(short).drawings().is_empty(), "{short}");
    }
}

#[test]
fn pictures_are_bounded_and_keep_their_shape() {
    let large = Picture::new(960, 30, vec![7; 960 * 30 * 3]).unwrap();
    assert_eq!((large.width_px, large.height_px), (PICTURE_PX, 15));
    let small = picture();
    assert_eq!((small.width_px, small.height_px), (4, 3), "small ones are not enlarged");
    let thin = Picture::new(2000, 1, vec![7; 2000 * 3]).unwrap();
    assert_eq!((thin.width_px, thin.height_px), (PICTURE_PX, 1));
    assert!(Picture::new(4, 3, vec![0; 5]).is_err() && Picture::new(0, 0, Vec::new()).is_err());
}

#[test]
fn splats_are_counted_where_nothing_hides_them() {
    // In front, behind what is drawn, and outside the image.
    let positions = [0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 9.0, 0.0, 2.0];
    let pinhole = Pinhole { fx_px: 4.0, fy_px: 4.0, cx_px: 4.0, cy_px: 4.0, width_px: 8, height_px: 8 };
    let camera = Camera { pinhole, camera_from_local: RigidTransform::IDENTITY };
    let image = |depth: f32| RenderedImage {
        width_px: 8,
        height_px: 8,
        rgb: Vec::new(),
        alpha: Vec::new(),
        depth: vec![depth; 64],
        normal: Vec::new(),
    };
    let mut seen = SeenCounter::new(&positions);
    seen.add(&camera, &image(2.0));
    let shares: Vec<f64> = seen.shares().iter().map(|(_, share)| (share * 3.0).round()).collect();
    assert_eq!(shares, [2.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    // Negative control: with nothing drawn in front, the second is seen too.
    seen.add(&camera, &image(0.0));
    let shares: Vec<f64> = seen.shares().iter().map(|(_, share)| (share * 3.0).round()).collect();
    assert_eq!(shares, [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
}
