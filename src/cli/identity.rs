//! Which capture a run was trained on: names of its views by side of the split, and its frame. Every
//! checkpoint carries it, so that a run is neither continued nor judged on other views by accident.

use super::capture::Capture;
use litetex_exporters::AssetCamera;
use litetex_gs::bake::asset_cameras;
use litetex_gs::camera::Similarity;
use litetex_gs::views::{Split, ViewSource};
use litetex_gs::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Key among the strings of a checkpoint.
pub const KEY: &str = "views";

/// Key of the cameras.
pub const CAMERAS: &str = "cameras";

/// The cameras of a run as text for a checkpoint: what assets carry.
///
/// # Errors
/// [`Error::Usage`] if they have no form in JSON, which does not happen.
pub fn cameras_json(views: &dyn ViewSource) -> Result<String> {
    serde_json::to_string(&asset_cameras(views))
        .map_err(|e| Error::Usage(format!("the cameras cannot be written: {e}")))
}

/// The cameras that a checkpoint carries; `None` for those that were written before it did.
///
/// # Errors
/// [`Error::InvalidInput`] if they are unreadable.
pub fn cameras(path: &Path, strings: &BTreeMap<String, String>) -> Result<Option<Vec<AssetCamera>>> {
    let unreadable = |e| Error::invalid(path, format!("entry {CAMERAS:?} of the checkpoint: {e}"));
    strings.get(CAMERAS).map(|text| serde_json::from_str(text).map_err(unreadable)).transpose()
}

/// Views and frame of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Names of the views trained on, in order.
    train: Vec<String>,
    /// Names of the views held out, in order.
    test: Vec<String>,
    /// Bits of the frame.
    capture_from_local: FrameBits,
}

/// A [`Similarity`] to the bit: the 16 hexadecimal digits of each f64.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct FrameBits {
    scale: String,
    translation: [String; 3],
}

impl Identity {
    /// Of views in a frame.
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

    /// Of a capture as it was read.
    pub fn of(capture: &Capture) -> Self {
        Self::new(capture, capture.capture_from_local)
    }

    /// As a string for a checkpoint.
    ///
    /// # Errors
    /// [`Error::Usage`] if it has no form in JSON, which does not happen.
    pub fn to_json(&self) -> Result<String> {
        serde_json::to_string(self)
            .map_err(|e| Error::Usage(format!("the names of the views cannot be written: {e}")))
    }

    /// What a checkpoint carries; `None` for those that were written before it was recorded.
    ///
    /// # Errors
    /// [`Error::InvalidInput`] if it is unreadable.
    pub fn from_strings(path: &Path, strings: &BTreeMap<String, String>) -> Result<Option<Self>> {
        let unreadable = |e| Error::invalid(path, format!("entry {KEY:?} of the checkpoint: {e}"));
        strings.get(KEY).map(|text| serde_json::from_str(text).map_err(unreadable)).transpose()
    }

    /// Whether the run can go on with a capture that is read as `now`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first view that differs.
    pub fn check_resumable(&self, now: &Self) -> Result<()> {
        for (before, now, role) in
            [(&self.train, &now.train, "a training view"), (&self.test, &now.test, "a test view")]
        {
            if let Some(what) = first_difference(before, now, role) {
                return Err(Error::Usage(format!(
                    "--resume: {what}; start a new run, or restore the capture and its split as they were"
                )));
            }
        }
        if self.capture_from_local != now.capture_from_local {
            return Err(Error::Usage(
                "--resume: position or scale of the capture differ from those of the run, its poses have \
                 changed; start a new run, or restore the capture"
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// Whether the scene and a capture that is read as `now` are in one frame.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_frame(&self, now: &Self) -> Result<()> {
        if self.capture_from_local == now.capture_from_local {
            return Ok(());
        }
        Err(Error::Usage(
            "this is not the capture the run was trained on: position or scale of its cameras differ; name \
             the right one with --capture, or restore it"
                .to_owned(),
        ))
    }

    /// Whether none of the views that `now` holds out was trained on.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first one.
    pub fn check_held_out(&self, now: &Self) -> Result<()> {
        let trained: BTreeSet<&String> = self.train.iter().collect();
        match now.test.iter().find(|name| trained.contains(name)) {
            None => Ok(()),
            Some(name) => Err(Error::Usage(format!(
                "test view {name:?} was a training view of the run, its figures would say nothing; restore \
                 the capture and its split as they were"
            ))),
        }
    }
}

/// The first name that only one of two lists has.
fn first_difference(before: &[String], now: &[String], role: &str) -> Option<String> {
    let only_in = |a: &[String], b: &[String]| {
        let b: BTreeSet<&String> = b.iter().collect();
        a.iter().find(|name| !b.contains(name)).cloned()
    };
    let counts = format!("{} then, {} now", before.len(), now.len());
    if let Some(name) = only_in(before, now) {
        return Some(format!("{name:?} was {role} of the run and is not now ({counts})"));
    }
    if let Some(name) = only_in(now, before) {
        return Some(format!("{name:?} is {role} now and was not in the run ({counts})"));
    }
    let other = before.iter().zip(now).find(|(b, n)| b != n);
    other.map(|(b, n)| format!("the order of the views differs: {n:?} stands where {b:?} stood"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(train: &[&str], test: &[&str], scale: f64) -> Identity {
        let names = |all: &[&str]| all.iter().map(|&n| n.to_owned()).collect();
        let hex = |x: f64| format!("{:016x}", x.to_bits());
        Identity {
            train: names(train),
            test: names(test),
            capture_from_local: FrameBits { scale: hex(scale), translation: [0.0, -0.0, 3.0].map(hex) },
        }
    }

    #[test]
    fn what_differs_first_is_named() {
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
    fn a_checkpoint_may_lack_it_but_not_garble_it() {
        let path = Path::new("c.safetensors");
        let run = identity(&["b"], &["ä \"1\""], 2.0);
        let strings = |text: String| BTreeMap::from([(KEY.to_owned(), text)]);
        assert_eq!(Identity::from_strings(path, &BTreeMap::new()).unwrap(), None);
        let read = Identity::from_strings(path, &strings(run.to_json().unwrap())).unwrap();
        assert_eq!(read, Some(run));
        assert_eq!(Identity::from_strings(path, &strings("{}".into())).unwrap_err().exit_code(), 3);
    }
}
