//! Converts cameras to the form that assets carry, and back.

use crate::Result;
use crate::camera::{Camera, Pinhole, RigidTransform};
use crate::image::TargetImage;
use crate::views::{Split, ViewSource};
use glam::{DMat3, DVec3};
use litetex_exporters::AssetCamera;
use std::sync::Arc;

/// The cameras of all views, in their order.
pub fn asset_cameras(views: &dyn ViewSource) -> Vec<AssetCamera> {
    let of_view = |v| asset_camera(views.name(v), views.split(v) == Split::Test, &views.camera(v));
    (0..views.num_views()).map(of_view).collect()
}

/// A camera as an asset carries it, under the name of its photo.
pub fn asset_camera(name: &str, held_out: bool, camera: &Camera) -> AssetCamera {
    let p = &camera.pinhole;
    AssetCamera {
        name: name.to_owned(),
        held_out,
        width_px: p.width_px,
        height_px: p.height_px,
        focal_px: [p.fx_px, p.fy_px],
        principal_px: [p.cx_px, p.cy_px],
        rotation_rows: camera.camera_from_local.rotation.transpose().to_cols_array_2d(),
        translation: camera.camera_from_local.translation.to_array(),
    }
}

/// The camera that an asset carries.
pub fn camera(asset: &AssetCamera) -> Camera {
    Camera {
        pinhole: Pinhole {
            width_px: asset.width_px,
            height_px: asset.height_px,
            fx_px: asset.focal_px[0],
            fy_px: asset.focal_px[1],
            cx_px: asset.principal_px[0],
            cy_px: asset.principal_px[1],
        },
        camera_from_local: RigidTransform {
            rotation: DMat3::from_cols_array_2d(&asset.rotation_rows).transpose(),
            translation: DVec3::from_array(asset.translation),
        },
    }
}

/// The cameras of an asset as views without photos.
pub struct AssetViews(pub Vec<AssetCamera>);

impl ViewSource for AssetViews {
    fn num_views(&self) -> usize {
        self.0.len()
    }

    fn name(&self, view: usize) -> &str {
        &self.0[view].name
    }

    fn split(&self, view: usize) -> Split {
        if self.0[view].held_out { Split::Test } else { Split::Train }
    }

    fn camera(&self, view: usize) -> Camera {
        camera(&self.0[view])
    }

    fn target(&self, view: usize) -> Result<Arc<TargetImage>> {
        Err(usage!("view {:?} of an asset has no photo", self.0[view].name))
    }
}
