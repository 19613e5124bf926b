//! COLMAP's binary files: little-endian, counts first, no padding. Counts are checked against the
//! length of the file before anything is allocated.

use super::bytes::{Bytes, read_file};
use super::colmap_model::{Broken, ColmapCamera, ColmapImage, ColmapModel, ColmapPoint, Parts};
use crate::Result;
use crate::text::quoted;
use std::path::Path;

/// Point id of a keypoint without a point.
const NO_POINT: u64 = u64::MAX;

/// Reads `cameras.bin`.
pub(crate) fn read_cameras(path: &Path) -> Result<Parts<ColmapCamera>> {
    let data = read_file(path)?;
    let mut bytes = Bytes::new(path, &data);
    // Id, model, size and the two parameters of the smallest model.
    let count = bytes.count(40, &|| "the number of cameras".to_owned())?;
    let mut cameras = Vec::with_capacity(count);
    for index in 0..count {
        let element = || format!("camera {} of {count}", index + 1);
        let id = bytes.u32(&element)?;
        let model = ColmapModel::by_number(bytes.i32(&element)?, path, id)?;
        let width = bytes.u64(&element)?;
        let height = bytes.u64(&element)?;
        let mut params = Vec::with_capacity(model.num_params);
        for _ in 0..model.num_params {
            params.push(f64::from_le_bytes(bytes.array(&element)?));
        }
        cameras.push(ColmapCamera { id, model: Ok(model), width, height, params });
    }
    bytes.finish()?;
    Ok(Parts { good: cameras, broken: Vec::new() })
}

/// Reads `images.bin`. Images whose name is no text are broken.
pub(crate) fn read_images(path: &Path) -> Result<Parts<ColmapImage>> {
    let data = read_file(path)?;
    let mut bytes = Bytes::new(path, &data);
    // Id, pose, camera, an empty name and the number of keypoints.
    let count = bytes.count(73, &|| "the number of images".to_owned())?;
    let mut images = Parts { good: Vec::with_capacity(count), broken: Vec::new() };
    for index in 0..count {
        let element = || format!("image {} of {count}", index + 1);
        let id = bytes.u32(&element)?;
        let quaternion = bytes.f64s(&element)?;
        let translation = bytes.f64s(&element)?;
        let camera_id = bytes.u32(&element)?;
        let name = bytes.text(&|| format!("the name of image {id}"))?;
        let num_keypoints = bytes.count(24, &|| {
            let name = String::from_utf8_lossy(name);
            format!("the number of keypoints of image {id} ({})", quoted(&name))
        })?;
        let mut point_ids = Vec::new();
        for keypoint in bytes.take(24 * num_keypoints, &element)?.chunks_exact(24) {
            let mut id = [0; 8];
            id.copy_from_slice(&keypoint[16..]);
            match u64::from_le_bytes(id) {
                NO_POINT => {}
                point => point_ids.push(point),
            }
        }
        match std::str::from_utf8(name) {
            Ok(name) => {
                let name = name.to_owned();
                images.good.push(ColmapImage { id, quaternion, translation, camera_id, name, point_ids });
            }
            Err(_) => images.broken.push(Broken {
                id: Some(id.into()),
                name: Some(String::from_utf8_lossy(name).into_owned()),
                place: "images.bin".to_owned(),
                what: "its name is not UTF-8 text".to_owned(),
            }),
        }
    }
    bytes.finish()?;
    Ok(images)
}

/// Reads `points3D.bin`.
pub(crate) fn read_points(path: &Path) -> Result<Parts<ColmapPoint>> {
    let data = read_file(path)?;
    let mut bytes = Bytes::new(path, &data);
    // Id, position, colour, error and the length of the track.
    let count = bytes.count(51, &|| "the number of points".to_owned())?;
    let mut points = Vec::with_capacity(count);
    for index in 0..count {
        let element = || format!("point {} of {count}", index + 1);
        let id = bytes.u64(&element)?;
        let position = bytes.f64s(&element)?;
        let rgb = bytes.array(&element)?;
        let [error_px] = bytes.f64s(&element)?;
        let track = bytes.count(8, &|| format!("the track length of point {id}"))?;
        bytes.take(8 * track, &element)?;
        points.push(ColmapPoint { id, position, rgb, error_px });
    }
    bytes.finish()?;
    Ok(Parts { good: points, broken: Vec::new() })
}
