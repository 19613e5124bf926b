//! All of an asset except its arrays, as a JSON object that glTF, USD, `.ltgs` and SPZ share. Numbers round-trip bit for
//! bit, except those of cameras in lossy `.ltgs` and in SPZ files (`meta_camera`).

use crate::asset::meta_camera::MetaCamera;
use crate::asset::overview::{Bounds, Overview};
use crate::{ColourSpace, Filter, Provenance, SplatAsset, Transform};
use serde::{Deserialize, Serialize, Serializer};

/// Most bytes of the object's text that readers accept.
pub const META_BYTES_MAX: usize = 16 << 20;

/// The object; the names of its fields are part of the formats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Meta {
    /// Near plane, local units; an f32, written with all the digits of the f64 that it equals.
    #[serde(serialize_with = "exactly")]
    pub near: f32,
    /// `"none"` or `"ewa"`.
    pub filter: Filter,
    /// Background of the training, in the colour space; written as `near` is.
    #[serde(serialize_with = "each_exactly")]
    pub background: [f32; 3],
    /// `"srgb_rec709_display"` or `"lin_rec709_display"`.
    pub colour_space: ColourSpace,
    /// From the local frame to that of the capture.
    pub capture_from_local: Transform,
    /// From there to the frame of the file; absent if that is the same.
    #[serde(default, skip_serializing_if = "Transform::is_identity")]
    pub world_from_capture: Transform,
    /// Title, author, licence, source, program version, facts about the training.
    pub provenance: Provenance,
    /// Where the bulk of what is seen lies, local frame; absent if there are no splats. For viewers, which fit it into the
    /// image; readers do not keep it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounds: Option<Bounds>,
    /// Index of the camera of the home view; absent without cameras. As `bounds`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub home: Option<usize>,
    /// Cameras of the capture.
    pub cameras: Vec<MetaCamera>,
}

/// Writes an f32 so that readers of f64 get the same number from every format.
fn exactly<S: Serializer>(value: &f32, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_f64((*value).into())
}

/// See [`exactly`].
fn each_exactly<S: Serializer>(values: &[f32; 3], serializer: S) -> Result<S::Ok, S::Error> {
    values.map(f64::from).serialize(serializer)
}

impl Meta {
    /// The metadata of an asset.
    pub fn of(asset: &SplatAsset) -> Self {
        let Overview { bounds, home } = Overview::of(asset);
        Self {
            bounds,
            home,
            near: asset.near,
            filter: asset.filter,
            background: asset.background,
            colour_space: asset.colour_space,
            capture_from_local: asset.capture_from_local,
            world_from_capture: asset.world_from_capture,
            provenance: asset.provenance.clone(),
            cameras: asset.cameras.iter().map(MetaCamera::exact).collect(),
        }
    }

    /// The metadata of an asset with short numbers of its cameras, which are most of the metadata of lossy `.ltgs` and of SPZ files.
    pub(crate) fn with_short_cameras(asset: &SplatAsset) -> Self {
        let short = |camera| MetaCamera::short(camera, asset.near);
        Self { cameras: asset.cameras.iter().map(short).collect(), ..Self::of(asset) }
    }

    /// Stores the metadata in an asset.
    pub fn store(self, asset: &mut SplatAsset) {
        asset.near = self.near;
        asset.filter = self.filter;
        asset.background = self.background;
        asset.colour_space = self.colour_space;
        asset.capture_from_local = self.capture_from_local;
        asset.world_from_capture = self.world_from_capture;
        asset.provenance = self.provenance;
        asset.cameras = self.cameras.into_iter().map(Into::into).collect();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn numbers_round_trip_bit_for_bit() {
        let mut asset = fixture(3, 0);
        asset.near = 0.1 + f32::EPSILON;
        asset.filter = Filter::Ewa;
        asset.capture_from_local = Transform {
            scale: 1.0 / 3.0,
            rotation: [0.6, -0.0, 0.8, 0.0],
            translation: [1e6 / 7.0, 5e-324, -0.0],
        };
        asset.background = [0.1, 0.2, 1.0];
        asset.colour_space = ColourSpace::LinRec709Display;
        asset.provenance.training.insert("steps".into(), "7000".into());
        let text = serde_json::to_string(&Meta::of(&asset)).unwrap();
        // The same digits as in a tree of JSON values, which holds numbers as f64.
        assert_eq!(
            serde_json::to_value(Meta::of(&asset)).unwrap(),
            serde_json::from_str::<serde_json::Value>(&text).unwrap()
        );
        assert!(text.contains(&format!("\"near\":{:?},", f64::from(asset.near))), "{text}");
        assert!(text.contains("\"lin_rec709_display\"") && text.contains("\"captureFromLocal\""), "{text}");
        let mut read = SplatAsset { near: 9.0, ..asset.clone() };
        serde_json::from_str::<Meta>(&text).unwrap().store(&mut read);
        assert_eq!(Meta::of(&read), Meta::of(&asset));
        assert!(read.capture_from_local.translation[2].is_sign_negative());
    }
}
