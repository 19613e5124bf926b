//! What the page is told about the scene it shows: inside a file, or by the program that serves it.

use serde::{Deserialize, Serialize};

/// Name and version of the object.
const SCHEMA: &str = "litetex-view/1";

/// The object; the names of its fields are part of the interface with the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Session {
    /// `"litetex-view/1"`.
    pub schema: String,
    /// Title of the scene; may be empty.
    pub title: String,
    /// Name and version of the program.
    pub program: String,
    /// The scene; `None` where there is none yet.
    pub asset: Option<SessionAsset>,
    /// Photos of the capture; `None` if they are not at hand.
    pub photos: Option<Vec<SessionPhoto>>,
    /// The training that the scene comes from.
    pub training: Option<SessionTraining>,
}

/// The scene of a session.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SessionAsset {
    /// Where its bytes are; `None` if they are in the page.
    pub url: Option<String>,
    /// Size of the file.
    pub bytes: u64,
    /// `"ltgs"` or `"glb"`.
    pub format: String,
    /// Name to show; may be empty.
    pub name: String,
    /// Grows with each change of the scene.
    pub revision: u64,
}

/// A photo of a session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SessionPhoto {
    /// Name of the photo, as the scene's cameras have it.
    pub view: String,
    /// Where its bytes are.
    pub url: String,
    /// Width of the image.
    pub width_px: u32,
    /// Height of the image.
    pub height_px: u32,
}

/// Whether a training goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrainingState {
    /// It does.
    Running,
    /// It has done what it was to do.
    Finished,
    /// It was interrupted, or its process is gone.
    Stopped,
}

/// The training of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct SessionTraining {
    /// Steps done.
    pub step: u32,
    /// Steps planned.
    pub steps: u32,
    /// Predicted time left, seconds; `None` if it is not known, or nothing is left.
    pub eta_secs: Option<f64>,
    /// Splats of the model.
    pub splats: u64,
    /// Texels of the model.
    pub texels: u64,
    /// Steps, each with the figure that `curve_of` names.
    pub curve: Vec<(u32, f64)>,
    /// `"psnr"`, of the test views, dB, or `"loss"`, where those were not evaluated twice.
    pub curve_of: String,
    /// Whether it goes on.
    pub state: TrainingState,
    /// Grows with each change of the fields before.
    pub revision: u64,
}

impl Session {
    /// The session of a scene with this title.
    pub fn new(title: &str) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            title: title.to_owned(),
            program: concat!("litetex ", env!("CARGO_PKG_VERSION")).to_owned(),
            asset: None,
            photos: None,
            training: None,
        }
    }

    /// As JSON that may stand in an HTML element: without `<`, which could end it.
    pub fn to_inline_json(&self) -> String {
        serde_json::to_string(self).unwrap_or_default().replace('<', "\\u003c")
    }
}
