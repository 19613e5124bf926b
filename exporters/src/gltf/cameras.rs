//! Cameras of glTF: the home view first. Perspective cameras have their principal point in the middle; where that of a photo
//! is not, only our metadata tell.

use super::document::Node;
use crate::SplatAsset;
use crate::fallback::shown_cameras::{Cameras, DIGITS, ShownCamera};
use crate::number::rounded;
use serde_json::{Value, json};

/// Adds a node for each camera behind `nodes`, and returns the objects `cameras`, of which equal lenses share one.
pub fn push(asset: &SplatAsset, which: Cameras, nodes: &mut Vec<Node>) -> Vec<Value> {
    let mut lenses: Vec<Value> = Vec::new();
    for camera in ShownCamera::of(asset, which) {
        let [width, height] = camera.size;
        let lens = json!({
            "type": "perspective",
            "perspective": {
                "yfov": rounded(2.0 * (0.5 * height).atan(), DIGITS),
                "aspectRatio": rounded(width / height, DIGITS),
                "znear": camera.near,
            }
        });
        let index = lenses.iter().position(|other| *other == lens).unwrap_or_else(|| {
            lenses.push(lens);
            lenses.len() - 1
        });
        let [w, x, y, z] = camera.rotation;
        nodes.push(Node {
            name: Some(camera.name),
            camera: Some(index as u32),
            translation: Some(camera.centre),
            rotation: Some([x, y, z, w]),
            ..Node::default()
        });
    }
    lenses
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fallback::shown_cameras::tests::with_cameras;
    use crate::gltf::{GltfOptions, decode_glb, encode_glb};
    use crate::{Quality, ReadLimits};
    use std::path::Path;

    #[test]
    fn the_home_view_comes_first_and_equal_lenses_are_shared() {
        let asset = with_cameras();
        for quality in [Quality::Lossless, Quality::Tiny] {
            let file = |cameras| {
                encode_glb(&asset, &GltfOptions { quality, cameras, ..GltfOptions::default() }).unwrap()
            };
            let json = |bytes: &[u8]| -> Value {
                let length = u32::from_le_bytes(*bytes[12..].first_chunk().unwrap()) as usize;
                serde_json::from_slice(&bytes[20..20 + length]).unwrap()
            };
            let (home, all) = (json(&file(Cameras::Home)), json(&file(Cameras::All)));
            assert_eq!(
                (&home["scenes"][0]["nodes"], &all["scenes"][0]["nodes"]),
                (&json!([0, 1]), &json!([0, 1, 2]))
            );
            assert_eq!((&home["nodes"][1], &all["nodes"][2]["name"]), (&all["nodes"][1], &json!("b.png")));
            assert_eq!(
                (&all["nodes"][1]["camera"], all["cameras"].as_array().unwrap().len()),
                (&json!(0), 1)
            );
            // 40 x 30 pixels of focal lengths 35 and 36.
            let lens = &all["cameras"][0]["perspective"];
            let tangents =
                lens["yfov"].as_f64().map(|y| [(0.5 * y).tan(), lens["aspectRatio"].as_f64().unwrap()]);
            assert!(
                tangents.is_some_and(|[up, aspect]| (up - 15.0 / 36.0).abs() < 1e-8
                    && (up * aspect - 20.0 / 35.0).abs() < 1e-8)
            );
            // Readers take cameras from the metadata, and the splats are the same.
            let read = |bytes: &[u8]| decode_glb(bytes, Path::new("a.glb"), &ReadLimits::default()).unwrap();
            let (a, b) = (read(&file(Cameras::Home)), read(&file(Cameras::All)));
            assert_eq!((&a.asset, a.warnings.len(), b.warnings.len()), (&b.asset, 0, 0));
            assert_eq!(a.asset.cameras.len(), 2);
        }
    }
}
