//! Which direction of a capture is up: one rule for exported files, orbits and the page.
//!
//! 1. The direction to which the photos are level, with its sign by the photos' upward directions.
//! 2. Where they leave it open, because they all face alike: the pose format's own up, where it states one.
//! 3. Else the mean of the photos' upward directions, within what is open.
//! 4. Else -y, as images have y down.
//!
//! The mean of the upward directions alone would tilt what was photographed from above.

use super::level::{Axes, Fit, fit, fit_portrait};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Least share of photos that are level without a warning. Measured: 41 of 50 in fox, all in the other captures; at a roll of 15
/// degrees (standard deviation) half, at 20 degrees two fifths; of cameras held anyhow a quarter to a third.
const LEVEL_SHARE_MIN: f64 = 0.5;

/// Expected error of up from which photos do not tell what is up, degrees. Measured: of 60 cameras held anyhow at least 15, of 12
/// at least 10; of photos over a third of a circle with a roll of 20 degrees in the middle 5.5 and 11. What is taken instead,
/// the mean of the upward directions, is off by 24 where photos look 30 degrees down.
const ERROR_MAX_DEGREES: f64 = 14.0;

/// Expected error of up from which there is a warning, degrees; the error itself is hardly ever more than three times as large.
/// Measured, expected: fox 1.2, the other captures at most 1.0; simulated, 32 photos with a roll of 3 degrees 0.7, of 8 degrees 2,
/// of 15 degrees 4.
const ERROR_WARNED_DEGREES: f64 = 3.0;

/// Directions this close to an axis of the capture are that axis, degrees.
const SNAP_DEGREES: f64 = 5.0;

/// A format's own up that is further from that of the photos gets a warning, degrees.
const APART_DEGREES: f64 = 20.0;

/// Shortest mean of the photos' upward directions that says what is up. Measured: flower, whose photos all face alike, 1.00;
/// simulated, facing alike by hand 0.996, a camera that tilts over half a circle 0.64, over three quarters 0.30. Of 20 cameras
/// held anyhow, 95 of 100 captures are below 0.30, of 60 below 0.21; strips photographed straight down, to and fro, 0.004.
const MEAN_MIN: f64 = 0.3;

/// Where all right axes are alike, cameras pan in portrait or tilt. That tilts cover at most half a circle leaves a mean of the
/// upward directions of at least 2 / pi.
const TILTED_MEAN_MIN: f64 = 0.6;

/// Least mean that decides between up and down. Measured: lego 0.78, bonsai 0.82, fox 0.96, castle of Sceaux 0.99; simulated
/// orbits that look 60 degrees down 0.50, 80 down 0.17, 80 up, from below, 0.18, 84 down 0.10, a quarter of the photos upside
/// down 0.47. Where the other rules are to decide: photos straight down, held to within 6 degrees, 0.004; half upside down 0.
const SIGN_MIN: f64 = 0.1;

/// Sine of the mean pitch from which photos in portrait are taken to look down. Photos that are taken standing do not reach it,
/// so that buildings photographed from below stay upright; measured, up or down: flower 0.05, fox 0.09, castle of Sceaux 0.15.
/// Photos of what lies below do: lego 0.53, bonsai 0.55. Of simulated photos in portrait, turned either way, 20 degrees down
/// 0.35; of the two ways, that of EXIF 6 is taken where they look down by less. Photos in portrait alone that look up by more
/// than 15 degrees come out upside down.
const LOOKS_DOWN_MIN: f64 = 0.25;

/// What tells which direction is up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum UpSource {
    /// The photos are level to it.
    LevelPhotos,
    /// The pose format states it, and the photos leave it open.
    PoseFormat,
    /// The mean of the photos' upward directions, for they leave it open.
    MeanOfPhotos,
    /// Nothing; -y.
    Assumed,
}

/// The direction of a capture that is up, and why.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Up {
    /// Unit vector in the frame of the capture.
    pub in_capture: DVec3,
    /// What tells.
    pub source: UpSource,
    /// Number of photos that are level to within 10 degrees, those in portrait included.
    pub level_photos: usize,
    /// Number of photos.
    pub photos: usize,
    /// Eigenvalues of the covariance of the photos' level axes about the origin, ascending; their sum is 1.
    pub eigenvalues: [f64; 3],
    /// Expected error, degrees: by how much the photos are rolled, or half the angle to another direction that is nearly as
    /// probable; `None` where they all face alike.
    pub error_degrees: Option<f64>,
    /// Degrees between what the photos leave possible and the up that the pose format states; `None` if it states none.
    pub apart_degrees: Option<f64>,
}

/// Finds up from the rotations of `camera_from_capture`, and from what the pose format states, a unit vector.
pub fn find(rotations: impl IntoIterator<Item = DMat3>, stated: Option<DVec3>) -> Up {
    let photos: Vec<Axes> = rotations.into_iter().map(|rotation| Axes::of(&rotation)).collect();
    let mean = photos.iter().map(|p| -p.down).sum::<DVec3>() / photos.len().max(1) as f64;
    let fitted = fit(&photos).map(|fit| panned_in_portrait(&fit, &photos, mean).unwrap_or(fit));
    let up = |in_capture: DVec3, source| Up {
        in_capture: snapped(in_capture),
        source,
        level_photos: fitted.map_or(0, |fit| fit.num_level),
        photos: photos.len(),
        eigenvalues: fitted.map_or([0.0; 3], |fit| fit.eigenvalues),
        error_degrees: fitted.filter(|fit| !fit.is_open()).map(|fit| fit.error_degrees),
        apart_degrees: None,
    };
    let (found, apart_degrees) = match fitted {
        Some(fit) if !fit.is_open() && fit.error_degrees <= ERROR_MAX_DEGREES => {
            let level = signed(&fit, &photos);
            let rival = fit.rival.map(|vertical| signed(&Fit { vertical, ..fit }, &photos));
            let half_apart = rival.map_or(0.0, |rival| 0.5 * degrees(rival.dot(level)));
            let found = up(level, UpSource::LevelPhotos);
            let found = Up { error_degrees: found.error_degrees.map(|e| e.max(half_apart)), ..found };
            (found, stated.map(|stated| degrees(found.in_capture.dot(stated))))
        }
        _ => {
            let common = fitted.filter(Fit::is_open).map_or(DVec3::ZERO, |fit| fit.common);
            let within = mean - common * mean.dot(common);
            let found = match (stated, within.length() >= MEAN_MIN) {
                (Some(stated), _) => up(stated, UpSource::PoseFormat),
                (None, true) => up(within.normalize(), UpSource::MeanOfPhotos),
                (None, false) => up(DVec3::NEG_Y, UpSource::Assumed),
            };
            (found, stated.map(|stated| 90.0 - degrees(stated.dot(common).abs())))
        }
    };
    Up { apart_degrees, ..found }
}

impl Up {
    /// The direction, as `--up` takes it, and why.
    pub fn words(&self) -> String {
        let why = match self.source {
            UpSource::LevelPhotos => {
                format!("{} of {} photos are level to it", self.level_photos, self.photos)
            }
            UpSource::PoseFormat => "the pose format says so, and the photos leave it open".to_owned(),
            UpSource::MeanOfPhotos => {
                "the mean of the photos' upward directions, for what is level in them leaves it open"
                    .to_owned()
            }
            UpSource::Assumed => "the photos do not tell, so it is taken as in COLMAP's images".to_owned(),
        };
        format!("{}: {why}", direction_text(self.in_capture.to_array()))
    }

    /// What to warn of, if the photos are rolled and nothing else tells what is up.
    pub fn uncertainty(&self) -> Option<String> {
        let error = self.error_degrees?;
        let why = match self.source {
            UpSource::LevelPhotos if error > ERROR_WARNED_DEGREES => {
                format!("the photos are rolled, so that it may be off by {:.0} degrees", 2.0 * error)
            }
            UpSource::LevelPhotos if (self.level_photos as f64) < LEVEL_SHARE_MIN * self.photos as f64 => {
                "most photos are rolled".to_owned()
            }
            UpSource::MeanOfPhotos | UpSource::Assumed => "the photos are rolled too much to tell".to_owned(),
            UpSource::LevelPhotos | UpSource::PoseFormat => return None,
        };
        Some(format!("up is {}; {why}; files are turned by --up of \"litetex export\"", self.words()))
    }

    /// What to warn of, if the format's own up is another.
    pub fn disagreement(&self) -> Option<String> {
        let apart = self.apart_degrees.filter(|degrees| *degrees > APART_DEGREES)?;
        let what = match self.source {
            UpSource::LevelPhotos => "the photos are level to another direction",
            _ => "the photos, which all face alike, lie on their side then",
        };
        Some(format!(
            "up is {}; the pose format has an up of its own, and {what}, {apart:.0} degrees apart; files are turned by \
             --up of \"litetex export\"",
            self.words()
        ))
    }
}

/// A direction as text: an axis such as `-y`, or three numbers.
pub fn direction_text(direction: [f64; 3]) -> String {
    let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    for (i, axis) in ["x", "y", "z"].iter().enumerate() {
        if direction[i].abs() >= length {
            return format!("{}{axis}", if direction[i] < 0.0 { "-" } else { "" });
        }
    }
    // Without the sign of what rounds to zero.
    direction.map(|v| format!("{:.4}", (v * 1e4).round() / 1e4 + 0.0)).join(",")
}

fn share(fit: &Fit, photos: &[Axes]) -> f64 {
    fit.num_level as f64 / photos.len().max(1) as f64
}

/// The fit of photos in portrait alone, from cameras that go around: their right axes are all vertical.
fn panned_in_portrait(open: &Fit, photos: &[Axes], mean: DVec3) -> Option<Fit> {
    if !open.is_open() || mean.length() >= TILTED_MEAN_MIN {
        return None;
    }
    let upright = fit_portrait(photos, open.common)?;
    (!upright.is_open() && share(&upright, photos) >= LEVEL_SHARE_MIN).then_some(upright)
}

/// Up rather than down.
fn signed(fit: &Fit, photos: &[Axes]) -> DVec3 {
    let vertical = fit.vertical;
    let (portrait, landscape) = fit.level(photos);
    let mean = |of: &[&Axes], axis: fn(&Axes) -> DVec3| {
        of.iter().map(|p| axis(p).dot(vertical)).sum::<f64>() / of.len().max(1) as f64
    };
    let upward = mean(&landscape, |p| -p.down);
    let (ahead, sideways) = (mean(&portrait, |p| p.forward), mean(&portrait, |p| -p.right));
    let sign = if upward.abs() >= SIGN_MIN {
        upward
    } else if ahead.abs() >= LOOKS_DOWN_MIN {
        -ahead
    } else if sideways.abs() >= SIGN_MIN {
        // Phones store a portrait photo with its top at the left (EXIF orientation 6).
        sideways
    } else {
        // Photos that look straight down, as from drones.
        -mean(&landscape, |p| p.forward)
    };
    if sign < 0.0 { -vertical } else { vertical }
}

/// The nearest axis, if it is near.
fn snapped(direction: DVec3) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
    axes.into_iter().find(|axis| degrees(axis.dot(direction)) <= SNAP_DEGREES).unwrap_or(direction)
}

fn degrees(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}
