//! `KHR_gaussian_splatting` and our extension nested in it as JSON objects, and the digest that survives tools that drop both.

use super::KHR;
use crate::asset::hash::{hash_from_text, text_from_hash};
use crate::asset::meta::Meta;
use crate::files::sidecars::SidecarHashes;
use crate::{ColourSpace, Error, Quality, Result, SplatAsset, quoted};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;

/// Name of our extension.
pub const EXTENSION: &str = "LITETEX_gaussian_splatting_texture";

/// Version of our extension that is written and read.
pub const VERSION: u32 = 3;

/// Key of the digest in the `extras` of a primitive.
const DIGEST: &str = "litetex";

/// The object of `KHR_gaussian_splatting`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub struct Splatting {
    pub kernel: String,
    pub color_space: String,
    pub projection: Option<String>,
    pub sorting_method: Option<String>,
    pub extensions: Option<SplattingExtensions>,
}

/// Extensions nested in `KHR_gaussian_splatting`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SplattingExtensions {
    /// Ours, parsed only after its version was checked.
    #[serde(rename = "LITETEX_gaussian_splatting_texture")]
    pub texture: Option<Value>,
}

/// The object of our extension, version 3.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TextureExtension {
    pub version: u32,
    /// Name of a [`crate::Quality`].
    pub quality: String,
    /// 16 hexadecimal digits.
    pub hash: String,
    /// Hashes of sidecar files, by their URIs.
    #[serde(default, skip_serializing_if = "SidecarHashes::is_empty")]
    pub sidecars: SidecarHashes,
    /// Accessor of u16 VEC4 (x, y, cols, rows); absent if no splat has a map.
    pub rects: Option<u32>,
    /// Accessor of u8 or u16 SCALAR; absent if all maps are on page 0.
    pub pages: Option<u32>,
    /// Accessor of f32 VEC2.
    pub texel_size: Option<u32>,
    /// Accessor of i16 VEC2, half texels; absent if all maps are centred.
    pub shift: Option<u32>,
    /// Accessor of u8 SCALAR; absent if all splats have the degree of the attributes.
    pub sh_degree: Option<u32>,
    /// Accessor of f32 VEC3; absent if the attribute of degree 0 is exact.
    pub sh0: Option<u32>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub atlas: Vec<Page>,
    /// Texels of zero around each map on its page, at least; absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub border: Option<u16>,
    /// How codes become texels, with pages of 8 bits.
    pub decode: Option<Decode>,
    /// A `.ltgs` file in place of all these arrays and of the metadata.
    pub stream: Option<Stream>,
    /// There unless there is a stream.
    pub meta: Option<Meta>,
}

/// A page of the atlas, with exactly one of the three sources.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Page {
    pub width: u32,
    pub height: u32,
    /// A buffer view of raw f32 RGB.
    pub buffer_view: Option<u32>,
    /// A core texture whose image is a PNG.
    pub texture: Option<u32>,
    /// An EXR file.
    pub uri: Option<String>,
}

/// `texel = code * scale + bias`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Decode {
    pub scale: f64,
    pub bias: f64,
}

/// Where the stream is, and its codec.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Stream {
    pub buffer_view: u32,
    pub mime_type: String,
}

impl TextureExtension {
    /// An object without arrays.
    pub fn new(quality: Quality, hash: u64) -> Self {
        Self {
            version: VERSION,
            quality: quality.name().to_owned(),
            hash: text_from_hash(hash),
            ..Self::default()
        }
    }

    /// Parses the JSON object of a file.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for other versions, [`Error::Invalid`] for wrong or missing properties.
    pub fn parse(value: &Value, path: &Path) -> Result<Self> {
        match value.get("version").and_then(Value::as_u64) {
            Some(v) if v == u64::from(VERSION) => {}
            Some(v) => {
                let what = format!(
                    "{EXTENSION} of version {v}, supported: {VERSION}; export the scene again, or use a program of that version"
                );
                return Err(Error::unsupported(path, what));
            }
            None => return Err(invalid!(path, "{EXTENSION}: no whole number \"version\"")),
        }
        let offence = |what: String| invalid!(path, "{EXTENSION}: {what}");
        let found = Self::deserialize(value).map_err(|e| offence(e.to_string()))?;
        let beside = ["rects", "pages", "texelSize", "shift", "shDegree", "sh0", "atlas", "decode", "meta"]
            .into_iter()
            .find(|name| value.get(name).is_some());
        match (&found.stream, &found.meta, beside) {
            (None, Some(_), _) | (Some(_), _, None) => Ok(found),
            (None, None, _) => Err(offence("neither \"meta\" nor \"stream\"".to_owned())),
            (Some(_), _, Some(name)) => Err(offence(format!("{name:?} beside \"stream\""))),
        }
    }

    /// The hash as a number.
    pub fn hash(&self) -> Option<u64> {
        hash_from_text(&self.hash)
    }
}

/// What stays in `extras` when a tool drops extensions that it does not know, so that the loss is noticed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Digest {
    pub splats: u64,
    pub texels: u64,
    pub hash: String,
}

impl Digest {
    /// The digest of the asset that a reader gets.
    pub fn of(asset: &SplatAsset, hash: String) -> Self {
        Self { splats: asset.num_splats() as u64, texels: asset.num_texels() as u64, hash }
    }

    /// The digest as an `extras` object.
    pub fn to_extras(&self) -> Value {
        serde_json::json!({ DIGEST: self })
    }

    /// The digest in the `extras` of a primitive, if they have one.
    pub fn from_extras(extras: &Value) -> Option<Self> {
        Self::deserialize(extras.get(DIGEST)?).ok()
    }
}

impl Splatting {
    /// The object that is written, with our extension inside.
    pub fn new(colour_space: ColourSpace, texture: Value) -> Self {
        let name = match colour_space {
            ColourSpace::SrgbRec709Display => "srgb_rec709_display",
            ColourSpace::LinRec709Display => "lin_rec709_display",
        };
        Self {
            kernel: "ellipse".to_owned(),
            color_space: name.to_owned(),
            projection: Some("perspective".to_owned()),
            sorting_method: Some("cameraDistance".to_owned()),
            extensions: Some(SplattingExtensions { texture: Some(texture) }),
        }
    }

    /// Our extension, if the object has it.
    pub fn texture(&self) -> Option<&Value> {
        self.extensions.as_ref()?.texture.as_ref()
    }

    /// The colour space of the splats.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for spaces that the specification does not define.
    pub fn colour_space(&self, path: &Path) -> Result<ColourSpace> {
        ColourSpace::deserialize(&Value::String(self.color_space.clone())).map_err(|_| {
            let what = format!(
                "{KHR}: colorSpace {}, supported: \"srgb_rec709_display\", \"lin_rec709_display\"",
                quoted(&self.color_space)
            );
            Error::unsupported(path, what)
        })
    }
}
