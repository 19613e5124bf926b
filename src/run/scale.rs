//! The scale of a run, as it was measured: a small file in its folder that all exports heed.

use crate::{Error, Result, atomic_file, input_file};
use litetex_exporters::{METRES, rounded};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The file, in the folder of a run.
pub(super) const SCALE_FILE: &str = "scale.json";
const SCHEMA: &str = "litetex-scale/1";
/// Largest file that is read.
const SCALE_BYTES_MAX: u64 = 1 << 16;
/// Digits of lengths: far more than anyone measures, and fewer than those that only show how a product was rounded.
const DIGITS: usize = 12;

/// How long a unit of a capture is, and how that was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scale {
    /// Always `"litetex-scale/1"`.
    schema: String,
    /// Metres of a unit of the capture.
    pub metres_per_unit: f64,
    /// The two points and their distance, as the user gave them.
    pub from: String,
    /// Where the points lie in the capture's frame, its units.
    pub points_in_capture: [[f64; 3]; 2],
    /// Their distance, metres.
    pub metres: f64,
}

impl Scale {
    /// The scale at which two points have this distance.
    ///
    /// # Errors
    /// [`Error::Usage`] if the points coincide, or no file can hold a scale that is that small or large.
    pub fn of(from: &str, points_in_capture: [[f64; 3]; 2], metres: f64) -> Result<Self> {
        let [a, b] = points_in_capture.map(glam::DVec3::from);
        let units = a.distance(b);
        if units == 0.0 {
            return Err(usage!(
                "--scale-from {from:?}: the two points lie at the same place; choose two that are far from each other"
            ));
        }
        let metres = rounded(metres, DIGITS);
        let metres_per_unit = rounded(metres / units, DIGITS);
        if !is_scale(metres_per_unit) {
            let found = match units.is_finite() {
                true => format!(
                    "{units:.3e} units apart, and a unit of {metres_per_unit:.3e} m is more or less than files can hold"
                ),
                false => "further apart than can be told".to_owned(),
            };
            return Err(usage!(
                "--scale-from {from:?}: the two points are {found}; check them and their distance"
            ));
        }
        Ok(Self {
            schema: SCHEMA.to_owned(),
            metres_per_unit,
            from: from.to_owned(),
            points_in_capture,
            metres,
        })
    }

    /// What files say of it.
    pub fn words(&self) -> String {
        format!("{METRES}: {} m between two points ({})", self.metres, self.from)
    }

    /// The scale that was measured for a run; `None` if none was.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::InvalidInput`] naming the file.
    pub fn read(run: &Path) -> Result<Option<Self>> {
        let path = run.join(SCALE_FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = input_file::read_text(&path, SCALE_BYTES_MAX)?;
        let remedy = "measure again with export --scale-from, or delete the file";
        let scale: Self = serde_json::from_str(&text).map_err(|e| invalid!(&path, "{e}; {remedy}"))?;
        if scale.schema != SCHEMA {
            return Err(invalid!(&path, "schema {:?}, expected {SCHEMA:?}; {remedy}", scale.schema));
        }
        if !is_scale(scale.metres_per_unit) {
            let found = scale.metres_per_unit;
            let expected = "a positive number that a file can hold as f32";
            return Err(invalid!(&path, "metres_per_unit is {found}, expected {expected}; {remedy}"));
        }
        Ok(Some(scale))
    }

    /// Keeps it beside the run, in place of an earlier one.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Usage`] if the place of the file is taken.
    pub fn store(&self, run: &Path) -> Result<()> {
        let text =
            serde_json::to_string_pretty(self).map_err(|e| usage!("the scale cannot be written: {e}"))?;
        Ok(atomic_file::write(&run.join(SCALE_FILE), format!("{text}\n").as_bytes())?)
    }

    /// Forgets the scale of a run. Returns whether there was one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove(run: &Path) -> Result<bool> {
        let path = run.join(SCALE_FILE);
        match std::fs::remove_file(&path) {
            Ok(()) => Ok(true),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(false),
            Err(e) => Err(Error::io(&path, e)),
        }
    }
}

/// Whether positions times this number are positions that files can hold, which do it as f32.
fn is_scale(metres_per_unit: f64) -> bool {
    (metres_per_unit as f32).is_normal() && metres_per_unit > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_is_kept_and_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Scale::read(folder.path()).unwrap(), None);
        let scale = Scale::of("0,0,0 0,3,4 = 10m", [[0.0; 3], [0.0, 3.0, 4.0]], 10.0).unwrap();
        assert_eq!(scale.metres_per_unit, 2.0);
        scale.store(folder.path()).unwrap();
        assert_eq!(Scale::read(folder.path()).unwrap(), Some(scale));
        std::fs::write(folder.path().join(SCALE_FILE), "{}").unwrap();
        assert_eq!(Scale::read(folder.path()).unwrap_err().exit_code(), 3);
        assert!(Scale::remove(folder.path()).unwrap() && !Scale::remove(folder.path()).unwrap());
    }

    #[test]
    fn lengths_have_few_digits_and_errors_say_what_is_wrong() {
        let of = |x: f64, metres: f64| Scale::of("x", [[0.0; 3], [x, 0.0, 0.0]], metres);
        let feet = of(1.0, 3.0 * 0.3048).unwrap();
        assert_eq!((feet.metres, feet.metres_per_unit), (0.9144, 0.9144));
        assert!(feet.words().contains(" 0.9144 m "), "{}", feet.words());
        assert_eq!(of(3.0, 1.0).unwrap().metres_per_unit, 0.333_333_333_333);
        for (x, metres, words) in [
            (0.0, 1.0, "same place"),
            (1e300, 2.0, "further apart"),
            (1e-100, 2.0, "units apart"),
            (1.0, 1e60, "units apart"),
        ] {
            let error = of(x, metres).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains(words), "{error}");
        }
    }
}
