//! An order of splats for viewers that do not sort: far to near, as the cameras of the capture see them on average.

use crate::fallback::quads::Quad;
use crate::{AssetCamera, SplatAsset};

/// Sorts splats (indices) by their mean depth over the training cameras, the farthest first. Cameras that have a splat in
/// their image count, all of them for a splat that none has. Without cameras, the order stays.
fn far_to_near(asset: &SplatAsset, splats: &mut [usize]) {
    let cameras: Vec<&AssetCamera> = asset.cameras.iter().filter(|camera| !camera.held_out).collect();
    let mean_depth = |&splat: &usize| {
        let points = cameras.iter().map(|camera| seen(camera, asset.positions[splat]));
        let (mut visible, mut all) = ((0.0, 0.0), (0.0, 0.0));
        for (depth, is_visible) in points {
            all = (all.0 + depth, all.1 + 1.0);
            if is_visible {
                visible = (visible.0 + depth, visible.1 + 1.0);
            }
        }
        let (sum, count) = if visible.1 > 0.0 { visible } else { all };
        sum / f64::max(count, 1.0)
    };
    let mut by_depth: Vec<(f64, usize)> = splats.iter().map(|splat| (mean_depth(splat), *splat)).collect();
    by_depth.sort_by(|a, b| b.0.total_cmp(&a.0));
    splats.iter_mut().zip(by_depth).for_each(|(splat, (_, sorted))| *splat = sorted);
}

/// Places in a list of quads, which is in the order of their splats, sorted as [`far_to_near`] sorts the splats.
pub fn places_far_to_near(asset: &SplatAsset, quads: &[&Quad]) -> Vec<usize> {
    let mut order: Vec<usize> = quads.iter().map(|quad| quad.splat as usize).collect();
    far_to_near(asset, &mut order);
    let place = |splat| quads.partition_point(|quad| (quad.splat as usize) < splat);
    order.into_iter().map(place).collect()
}

/// Whether at least half of the training cameras stand on the side of a quad that its corners go round counter-clockwise.
pub fn faces_cameras(asset: &SplatAsset, quad: &Quad) -> bool {
    let [a, b, _, d] = quad.corners.map(|corner| corner.map(f64::from));
    let minus = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|i| p[i] - q[i]);
    let (u, v) = (minus(b, a), minus(d, a));
    let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let sees_front = |camera: &AssetCamera| {
        let AssetCamera { rotation_rows: rows, translation, .. } = camera;
        let along = |axis: usize| (0..3).map(|i| rows[i][axis] * translation[i]).sum::<f64>();
        // Corners have y up, the cameras' frame y down.
        let centre = [-along(0), along(1), along(2)];
        minus(centre, a).iter().zip(normal).map(|(x, n)| x * n).sum::<f64>() > 0.0
    };
    let training = || asset.cameras.iter().filter(|camera| !camera.held_out);
    2 * training().filter(|camera| sees_front(camera)).count() >= training().count()
}

/// Depth of a point, and whether it is in the camera's image.
fn seen(camera: &AssetCamera, point: [f32; 3]) -> (f64, bool) {
    let along = |axis: usize| {
        let row = camera.rotation_rows[axis];
        (0..3).map(|c| row[c] * f64::from(point[c])).sum::<f64>() + camera.translation[axis]
    };
    let [x, y, depth] = [0, 1, 2].map(along);
    let is_within = |offset: f64, axis: usize, size_px: u32| {
        let place_px = camera.focal_px[axis] * offset / depth + camera.principal_px[axis];
        (0.0..f64::from(size_px)).contains(&place_px)
    };
    (depth, depth > 0.0 && is_within(x, 0, camera.width_px) && is_within(y, 1, camera.height_px))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::{fixture, front};

    #[test]
    fn quads_are_turned_to_the_cameras() {
        let corners = [[0.0, 0.0, -5.0], [1.0, 0.0, -5.0], [1.0, 1.0, -5.0], [0.0, 1.0, -5.0]];
        let quad = Quad { splat: 0, page: 0, corners, uvs: [[0.0; 2]; 4] };
        let rotation_rows = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let front = AssetCamera { rotation_rows, ..AssetCamera::default() };
        let behind = AssetCamera { translation: [0.0, 0.0, -9.0], ..front.clone() };
        let with = |cameras: Vec<AssetCamera>| SplatAsset { cameras, ..fixture(4, 0) };
        // Corners have y up and z backward: the front looks at cameras at the origin.
        assert!(faces_cameras(&with(vec![front.clone(), front.clone(), behind.clone()]), &quad));
        assert!(!faces_cameras(&with(vec![front.clone(), behind.clone(), behind.clone()]), &quad));
        assert!(faces_cameras(&with(Vec::new()), &quad), "no cameras");
        let turned = Quad { corners: [corners[0], corners[3], corners[2], corners[1]], ..quad };
        assert!(!faces_cameras(&with(vec![front]), &turned));
    }

    #[test]
    fn splats_are_sorted_by_the_cameras_that_see_them() {
        let mut asset = fixture(4, 0);
        asset.positions = vec![[0.0, 0.0, 2.0], [0.0, 0.0, 5.0], [9.0, 0.0, 3.0], [0.0, 0.0, -1.0]];
        let mut order = [0, 1, 2, 3];
        far_to_near(&asset, &mut order);
        assert_eq!(order, [0, 1, 2, 3], "no cameras");
        let front = front(50.0);
        asset.cameras = vec![front.clone()];
        far_to_near(&asset, &mut order);
        assert_eq!(order, [1, 2, 0, 3], "5, 3 and 2 in front, 1 behind");
        // A second camera at z = 10 looks back at them.
        let back = AssetCamera {
            rotation_rows: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
            translation: [0.0, 0.0, 10.0],
            ..front
        };
        asset.cameras.push(back);
        far_to_near(&asset, &mut order);
        // Mean depths 5 of the first two; 5 too of the third, which neither sees; 11 of the fourth.
        assert_eq!(order[0], 3);
        asset.cameras[1].held_out = true;
        far_to_near(&asset, &mut order);
        assert_eq!(order, [1, 2, 0, 3], "test views do not count");
    }
}
