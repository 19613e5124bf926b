//! How much of a photo its pinhole image keeps. A pinhole images less than half of all directions, and far from its axis
//! it spreads them over many pixels: of wide lenses it keeps the middle only.

use super::decode::Recipe;
use super::frame::median;
use super::lens::Lens;
use super::options::UndistortFocal;
use super::source::{SourceView, first_names};
use super::warp::{Warp, with_focal_scale};
use crate::Report;
use crate::camera::Pinhole;
use glam::DVec2;
use rayon::prelude::*;
use serde::Serialize;

/// Below this share of kept pixels we warn. Measured on samples of published calibrations (gyroflow/lens_profiles, OpenCV
/// fisheye), not on all of them: ultra-wide phones keep 86 to 100 % (iPhone 13 Pro 0.5x 99.7 %, Galaxy A51 94.7 %), GoPro Linear
/// 98 % and more, an anamorphic lens 83 %; GoPro Wide 60 to 68 % in 4:3 and 65 to 72 % in 16:9, DJI Action at 159 degrees 68 to
/// 70 %, DJI FPV 66 %, Insta360 One R 60 to 63 % in 96 of 110 calibrations, other lenses of 150 degrees and more 43 to 60 %. So
/// the threshold lies among those of action cameras, and parts the wider from the narrower of them only roughly. Ideal
/// equidistant fisheyes in 4:3: 84 % at a field of view of 76 degrees along the diagonal, 74 % at 104, 67 % at 127, 38 % at 239.
const KEPT_SHARE_MIN: f64 = 0.7;

/// Pixels kept by the focal length that `auto` chooses, as a share, unless the scale below is reached before.
const KEPT_SHARE_AIM: f64 = 0.95;

/// Shortest focal length that `auto` chooses, over that of the lens: it costs half of the resolution in the middle.
const FOCAL_SCALE_MIN: f64 = 0.5;

/// Steps of the search, from 1 to the shortest.
const FOCAL_STEPS: u32 = 32;

/// Cells of the pinhole image, along each side, whose areas in the photo are summed (a fisheye of 120 degrees: 64 cells
/// give the share to 0.003, these to 0.001).
const CELLS: u32 = 128;

/// What undistortion does to the photos of a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undistortion {
    /// Views whose photo is undistorted.
    pub views: usize,
    /// Smallest share of a photo's pixels that its pinhole image keeps.
    pub kept_share_min: f64,
    /// Median share.
    pub kept_share_median: f64,
    /// Share of every view, in their order; 1 without distortion.
    pub kept_shares: Vec<f64>,
    /// Shortest focal length of a pinhole image over that of its lens.
    pub focal_scale_min: f64,
}

/// Share of a photo's pixels that its pinhole image shows, if its focal length is `focal_scale` times the lens's.
fn kept_share(lens: &Lens, focal_scale: f64) -> f64 {
    let c = lens.pinhole;
    let warp = Warp::new(*lens, focal_scale);
    let (width, height) = (f64::from(c.width_px), f64::from(c.height_px));
    let share = |i: u32| f64::from(i) / f64::from(CELLS);
    let at = |i: f64, j: f64| warp.distorted_px(DVec2::new(width * i, height * j));
    let row = |j: u32| -> Vec<Option<DVec2>> { (0..=CELLS).map(|i| at(share(i), share(j))).collect() };
    let is_inside = |p: DVec2| p.x >= 0.0 && p.y >= 0.0 && p.x <= width && p.y <= height;
    let mut area = 0.0;
    let mut above = row(0);
    for j in 1..=CELLS {
        let below = row(j);
        for i in 1..=CELLS as usize {
            let corners = [above[i - 1], above[i], below[i], below[i - 1]];
            let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
            if is_inside(0.25 * (a + b + c + d)) {
                area += 0.5 * (c - a).perp_dot(d - b);
            }
        }
        above = below;
    }
    (area / (width * height)).clamp(0.0, 1.0)
}

/// The focal length of a lens's pinhole image over that of the lens.
fn focal_scale(lens: &Lens, wanted: UndistortFocal) -> f64 {
    if wanted == UndistortFocal::Lens || !lens.is_distorted() {
        return 1.0;
    }
    let scale = |step: u32| 1.0 - (1.0 - FOCAL_SCALE_MIN) * f64::from(step) / f64::from(FOCAL_STEPS);
    let mut scales = (0..=FOCAL_STEPS).map(scale);
    scales.find(|&scale| kept_share(lens, scale) >= KEPT_SHARE_AIM).unwrap_or(FOCAL_SCALE_MIN)
}

/// What the pinhole image of a view keeps of its photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Kept {
    /// Focal length of the pinhole image over that of the lens.
    pub focal_scale: f64,
    /// Share of the photo's pixels; `None` without distortion.
    share: Option<f64>,
}

impl Kept {
    fn of(lens: &Lens, wanted: UndistortFocal) -> Self {
        let focal_scale = focal_scale(lens, wanted);
        Self { focal_scale, share: lens.is_distorted().then(|| kept_share(lens, focal_scale)) }
    }
}

/// What the pinhole images keep, with the focal lengths that are wanted. Views share few lenses, each of which is measured
/// once.
pub(crate) fn kept(views: &[SourceView], wanted: UndistortFocal) -> Vec<Kept> {
    let mut lenses: Vec<&Lens> = Vec::new();
    let lens_of_view: Vec<usize> = views
        .iter()
        .map(|view| match lenses.iter().rposition(|lens| **lens == view.lens) {
            Some(known) => known,
            None => {
                lenses.push(&view.lens);
                lenses.len() - 1
            }
        })
        .collect();
    let kept: Vec<Kept> = lenses.into_par_iter().map(|lens| Kept::of(lens, wanted)).collect();
    lens_of_view.into_iter().map(|lens| kept[lens]).collect()
}

/// Sums up what the pinhole images keep and warns of wide lenses; `None` without distortion.
pub(crate) fn check(views: &[SourceView], kept: &[Kept], report: &mut Report) -> Option<Undistortion> {
    let rounded = |share: f64| (share * 1e4).round() / 1e4;
    let kept_shares: Vec<f64> = kept.iter().map(|kept| rounded(kept.share.unwrap_or(1.0))).collect();
    let distorted: Vec<usize> = (0..kept.len()).filter(|&v| kept[v].share.is_some()).collect();
    let kept_share_min = distorted.iter().map(|&v| kept_shares[v]).reduce(f64::min)?;
    let low: Vec<usize> = distorted.iter().copied().filter(|&v| kept_shares[v] < KEPT_SHARE_MIN).collect();
    if let Some(&worst) = low.iter().min_by(|a, b| kept_shares[**a].total_cmp(&kept_shares[**b])) {
        let is_auto = kept[worst].focal_scale < 1.0;
        let remedy = match is_auto {
            true => format!(
                "a focal length of {:.0} % of the lens's is the shortest that auto chooses, since a shorter one shows the middle \
                 too coarsely: what lies further out is not trained on",
                100.0 * kept[worst].focal_scale
            ),
            false => {
                "a shorter focal length may keep more: --set capture.undistort-focal=auto (inspect: --undistort-focal auto)"
                    .to_owned()
            }
        };
        let what = format!(
            "the lenses of {} of {} views are so wide that the pinhole images trained on keep less than {:.0} % of the \
             photos' pixels ({:.0} % of {}): {}; {remedy}",
            low.len(),
            views.len(),
            100.0 * KEPT_SHARE_MIN,
            100.0 * kept_shares[worst],
            crate::text::quoted(&views[worst].name),
            first_names(low.iter().map(|&v| views[v].name.as_str()))
        );
        report.warn("undistortion-loses-pixels", low.len(), what);
    }
    Some(Undistortion {
        views: distorted.len(),
        kept_share_min,
        kept_share_median: median(distorted.iter().map(|&v| kept_shares[v]).collect()).unwrap_or(1.0),
        focal_scale_min: kept.iter().map(|kept| kept.focal_scale).fold(1.0, f64::min),
        kept_shares,
    })
}

/// The pinhole of a view, at the size that the pose file states.
pub(crate) fn pinhole(recipe: &Recipe) -> Pinhole {
    with_focal_scale(&recipe.lens.pinhole, recipe.focal_scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::lens::{Distortion, Tilt};

    fn lens(focal_px: f64, distortion: Distortion) -> Lens {
        let pinhole = Pinhole {
            width_px: 160,
            height_px: 120,
            fx_px: focal_px,
            fy_px: focal_px,
            cx_px: 80.0,
            cy_px: 60.0,
        };
        Lens { pinhole, distortion }
    }

    fn fisheye(focal_px: f64) -> Lens {
        lens(focal_px, Distortion::Fisheye { k: [0.0; 6], tilt: Tilt::None })
    }

    /// The share by asking each pixel of the photo, of a fisheye without further terms, whether the pinhole sees it.
    fn counted(lens: &Lens, focal_scale: f64) -> f64 {
        let c = lens.pinhole;
        let (mut kept, finer) = (0, 4);
        for y in 0..finer * c.height_px {
            for x in 0..finer * c.width_px {
                let at = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / f64::from(finer);
                let distorted = (at - DVec2::new(c.cx_px, c.cy_px)) / c.fx_px;
                let theta = distorted.length();
                if theta < std::f64::consts::FRAC_PI_2 {
                    let p = distorted * (theta.tan() / theta) * c.fx_px * focal_scale;
                    kept += u32::from(p.x.abs() <= c.cx_px && p.y.abs() <= c.cy_px);
                }
            }
        }
        f64::from(kept) / f64::from(finer * finer * c.width_px * c.height_px)
    }

    #[test]
    fn kept_shares_are_those_counted_pixel_by_pixel() {
        for (focal_px, scale) in [(48.0, 1.0), (48.0, 0.5), (90.0, 1.0), (90.0, 0.7), (400.0, 1.0)] {
            let (found, expected) =
                (kept_share(&fisheye(focal_px), scale), counted(&fisheye(focal_px), scale));
            assert!((found - expected).abs() < 0.006, "{focal_px} {scale}: {found} {expected}");
        }
        assert!((kept_share(&lens(100.0, Distortion::None), 1.0) - 1.0).abs() < 1e-9);
        assert!((kept_share(&lens(100.0, Distortion::None), 2.0) - 0.25).abs() < 1e-9, "negative control");
    }

    /// What the warning about one lens says.
    fn warned(lens: Lens, wanted: UndistortFocal) -> String {
        let pose =
            crate::camera::RigidTransform { rotation: glam::DMat3::IDENTITY, translation: glam::DVec3::ZERO };
        let photo = crate::capture::photo_folder::Match {
            path: "a.jpg".into(),
            asked: "a.jpg".to_owned(),
            misfit: Default::default(),
        };
        let views = [SourceView::new("a.jpg".to_owned(), photo, lens, pose)];
        let mut report = Report::default();
        check(&views, &kept(&views, wanted), &mut report);
        report.warnings.pop().map(|warning| warning.message).unwrap_or_default()
    }

    #[test]
    fn the_warning_says_where_the_search_for_a_focal_length_ends() {
        let wide = fisheye(48.0);
        // Shorter ones than the search tries do keep more.
        assert!(kept_share(&wide, 0.25) > kept_share(&wide, FOCAL_SCALE_MIN) + 0.1);
        let text = warned(wide, UndistortFocal::Auto);
        assert!(text.contains("50 % of the lens's is the shortest that auto chooses"), "{text}");
        let text = warned(wide, UndistortFocal::Lens);
        assert!(text.contains("may keep more: --set capture.undistort-focal=auto"), "{text}");
        assert_eq!(warned(fisheye(110.0), UndistortFocal::Auto), "", "negative control");
    }

    #[test]
    fn auto_shortens_the_focal_length_as_much_as_it_must_and_no_more() {
        assert_eq!(focal_scale(&fisheye(48.0), UndistortFocal::Lens), 1.0);
        assert_eq!(focal_scale(&fisheye(48.0), UndistortFocal::Auto), FOCAL_SCALE_MIN);
        let moderate = fisheye(110.0);
        let scale = focal_scale(&moderate, UndistortFocal::Auto);
        assert!(kept_share(&moderate, 1.0) < 0.9 && scale > FOCAL_SCALE_MIN && scale < 1.0, "{scale}");
        let share = kept_share(&moderate, scale);
        assert!((KEPT_SHARE_AIM..KEPT_SHARE_AIM + 0.03).contains(&share), "{share}");
        let narrow = lens(300.0, Distortion::Radial { k: [-0.05, 0.0, 0.0, 0.0, 0.0, 0.0], p: [0.0; 2] });
        assert_eq!(focal_scale(&narrow, UndistortFocal::Auto), 1.0);
    }
}
