//! Identity of the capture that a run was trained on: the names of its views by side of the split, and its frame. Every
//! checkpoint carries both and the cameras, so that a run is neither continued nor evaluated on other views by
//! accident.

use crate::bake::asset_cameras;
use crate::camera::Similarity;
use crate::camera::up::Up;
use crate::text::quoted;
use crate::views::{Split, ViewSource};
use crate::{Error, Result};
use litetex_exporters::AssetCamera;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Key of a [`CaptureIdentity`] among the strings of a checkpoint.
pub const IDENTITY_KEY: &str = "views";

/// Key of the cameras among the strings of a checkpoint.
pub const CAMERAS_KEY: &str = "cameras";

/// Key of the [`Up`] of a capture among the strings of a checkpoint.
const UP_KEY: &str = "up";

/// Key of the program whose poses are in metres among the strings of a checkpoint.
const METRIC_KEY: &str = "metric";

/// Which direction of a run's capture is up, for a checkpoint.
///
/// # Errors
/// [`Error::Usage`] if it has no form in JSON, which does not happen.
pub fn store_up(views: &dyn ViewSource, strings: &mut BTreeMap<String, String>) -> Result<()> {
    let text = serde_json::to_string(&views.up()).map_err(|e| usage!("up cannot be written: {e}"))?;
    strings.insert(UP_KEY.to_owned(), text);
    Ok(())
}

/// The program by whose poses a unit of a run's capture is a metre, for a checkpoint; nothing if they do not say so.
pub fn store_metric(views: &dyn ViewSource, strings: &mut BTreeMap<String, String>) {
    if let Some(program) = views.metric() {
        strings.insert(METRIC_KEY.to_owned(), program.to_owned());
    }
}

/// The program by whose poses a unit of the capture is a metre, as a checkpoint carries it.
pub fn metric_from_strings(strings: &BTreeMap<String, String>) -> Option<String> {
    strings.get(METRIC_KEY).cloned()
}

/// Which direction of the capture is up, as a checkpoint carries it.
///
/// # Errors
/// [`Error::InvalidInput`] if it is missing or unreadable.
pub fn up_from_strings(path: &Path, strings: &BTreeMap<String, String>) -> Result<Up> {
    entry(path, strings, UP_KEY)
}

/// The cameras of a run, as assets carry them, for a checkpoint.
///
/// # Errors
/// [`Error::Usage`] if they have no form in JSON, which does not happen.
pub fn cameras_json(views: &dyn ViewSource) -> Result<String> {
    serde_json::to_string(&asset_cameras(views)).map_err(|e| usage!("the cameras cannot be written: {e}"))
}

/// The cameras that a checkpoint carries.
///
/// # Errors
/// [`Error::InvalidInput`] if they are missing or unreadable.
pub fn cameras_from_strings(path: &Path, strings: &BTreeMap<String, String>) -> Result<Vec<AssetCamera>> {
    entry(path, strings, CAMERAS_KEY)
}

/// An entry of a checkpoint's strings, read from JSON.
fn entry<T: DeserializeOwned>(path: &Path, strings: &BTreeMap<String, String>, key: &str) -> Result<T> {
    let text = strings.get(key).ok_or_else(|| invalid!(path, "the checkpoint lacks the entry {key:?}"))?;
    serde_json::from_str(text).map_err(|e| invalid!(path, "entry {key:?} of the checkpoint: {e}"))
}

/// The views and the frame of a capture as a run saw them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CaptureIdentity {
    /// Names of the training views, in order.
    train: Vec<String>,
    /// Names of the test views, in order.
    test: Vec<String>,
    capture_from_local: FrameBits,
}

/// A [`Similarity`] bit for bit: 16 hexadecimal digits for each f64.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct FrameBits {
    scale: String,
    translation: [String; 3],
}

impl CaptureIdentity {
    /// The identity of views that were moved into a local frame.
    pub fn new(views: &dyn ViewSource, capture_from_local: Similarity) -> Self {
        let names = |split| views.indices(split).into_iter().map(|v| views.name(v).to_owned()).collect();
        let hex = |x: f64| format!("{:016x}", x.to_bits());
        Self {
            train: names(Split::Train),
            test: names(Split::Test),
            capture_from_local: FrameBits {
                scale: hex(capture_from_local.scale),
                translation: capture_from_local.translation.to_array().map(hex),
            },
        }
    }

    /// As a string for a checkpoint.
    ///
    /// # Errors
    /// [`Error::Usage`] if it has no form in JSON, which does not happen.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string(self).map_err(|e| usage!("the names of the views cannot be written: {e}"))
    }

    /// The identity that a checkpoint carries.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] if it is missing or unreadable.
    pub fn from_strings(path: &Path, strings: &BTreeMap<String, String>) -> Result<Self> {
        entry(path, strings, IDENTITY_KEY)
    }

    /// Checks that the run can be continued with a capture whose identity is `now`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first difference.
    pub fn check_resumable(&self, now: &Self) -> Result<()> {
        for (before, now, role) in
            [(&self.train, &now.train, "a training view"), (&self.test, &now.test, "a test view")]
        {
            if let Some(what) = first_difference(before, now, role) {
                return Err(usage!(
                    "the run cannot be continued: {what}; start a new run, or restore the capture and its split"
                ));
            }
        }
        if self.capture_from_local != now.capture_from_local {
            return Err(Error::Usage(
                "the run cannot be continued: the poses of the capture have changed, its position or scale differ \
                 from the run's; start a new run, or restore the capture"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// Checks that the run and a capture whose identity is `now` share a local frame.
    ///
    /// # Errors
    /// [`Error::Usage`] if they do not.
    pub fn check_frame(&self, now: &Self) -> Result<()> {
        if self.capture_from_local == now.capture_from_local {
            return Ok(());
        }
        Err(Error::Usage(
            "this is not the capture the run was trained on: the position or scale of its cameras differ; name the \
             right one with --capture, or restore it"
                .to_owned(),
        ))
    }

    /// Checks that no test view of `now` was a training view of the run.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first that was.
    pub fn check_held_out(&self, now: &Self) -> Result<()> {
        let trained: BTreeSet<&String> = self.train.iter().collect();
        match now.test.iter().find(|name| trained.contains(name)) {
            None => Ok(()),
            Some(name) => Err(usage!(
                "test view {} was a training view of the run, so its figures would be meaningless; restore the capture \
                 and its split",
                quoted(name)
            )),
        }
    }
}

/// The first difference between two lists of names, in words.
fn first_difference(before: &[String], now: &[String], role: &str) -> Option<String> {
    let only_in = |a: &[String], b: &[String]| {
        let b: BTreeSet<&String> = b.iter().collect();
        a.iter().find(|name| !b.contains(name)).cloned()
    };
    let counts = format!("{} then, {} now", before.len(), now.len());
    if let Some(name) = only_in(before, now) {
        return Some(format!("{} was {role} of the run and is not now ({counts})", quoted(&name)));
    }
    if let Some(name) = only_in(now, before) {
        return Some(format!("{} is {role} now and was not in the run ({counts})", quoted(&name)));
    }
    let other = before.iter().zip(now).find(|(b, n)| b != n);
    other.map(|(b, n)| format!("the order of the views differs: {} is where {} was", quoted(n), quoted(b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(train: &[&str], test: &[&str], scale: f64) -> CaptureIdentity {
        let names = |all: &[&str]| all.iter().map(|&n| n.to_owned()).collect();
        let hex = |x: f64| format!("{:016x}", x.to_bits());
        CaptureIdentity {
            train: names(train),
            test: names(test),
            capture_from_local: FrameBits { scale: hex(scale), translation: [0.0, -0.0, 3.0].map(hex) },
        }
    }

    #[test]
    fn the_first_difference_is_named() {
        let run = identity(&["b", "c"], &["a"], 2.0);
        run.check_resumable(&run.clone()).unwrap();
        for (now, part) in [
            (identity(&["b"], &["a", "c"], 2.0), "\"c\" was a training view"),
            (identity(&["b", "c", "d"], &["a"], 2.0), "\"d\" is a training view now"),
            (identity(&["b", "c"], &[], 2.0), "\"a\" was a test view"),
            (identity(&["c", "b"], &["a"], 2.0), "order"),
            (identity(&["b", "c"], &["a"], 2.0_f64.next_up()), "scale"),
        ] {
            let error = run.check_resumable(&now).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains(part), "{error}");
        }
        run.check_frame(&identity(&[], &[], 2.0)).unwrap();
        assert!(run.check_frame(&identity(&["b", "c"], &["a"], 2.5)).is_err());
        run.check_held_out(&identity(&[], &["a", "e"], 1.0)).unwrap();
        let error = run.check_held_out(&identity(&[], &["a", "b"], 1.0)).unwrap_err();
        assert!(error.to_string().contains("\"b\""), "{error}");
    }

    #[test]
    fn a_missing_or_garbled_identity_is_refused() {
        let path = Path::new("c.safetensors");
        let run = identity(&["b"], &["ä \"1\""], 2.0);
        let strings = |text: String| BTreeMap::from([(IDENTITY_KEY.to_owned(), text)]);
        let read = CaptureIdentity::from_strings(path, &strings(run.to_json().unwrap())).unwrap();
        assert_eq!(read, run);
        for strings in [BTreeMap::new(), strings("{}".into())] {
            assert_eq!(CaptureIdentity::from_strings(path, &strings).unwrap_err().exit_code(), 3);
        }
    }
}
