//! Which cells of a coarse view the splats at points cover.

use super::points::LocalPoint;
use crate::camera::Camera;
use glam::DVec2;

/// Calls `visit` for each cell of a view whose centre lies within `reach` standard deviations of a point's splat.
pub(super) fn visit_cells(
    camera: &Camera,
    near: f32,
    points: &[LocalPoint],
    reach: f64,
    mut visit: impl FnMut(usize),
) {
    let pinhole = &camera.pinhole;
    let (columns, rows) = (pinhole.width_px as usize, pinhole.height_px as usize);
    for point in points {
        let in_camera = camera.camera_from_local.transform_point(point.position_in_local());
        let Some(at) = pinhole.project(in_camera).filter(|_| in_camera.z > f64::from(near)) else {
            continue;
        };
        let reach_px =
            reach * f64::from(point.sigma) / in_camera.z * DVec2::new(pinhole.fx_px, pinhole.fy_px);
        // Cells whose centres lie in the box around the disc.
        let span = |at: f64, reach: f64, cells: usize| {
            let bound = |v: f64| v.clamp(0.0, cells as f64) as usize;
            bound((at - reach - 0.5).ceil())..bound((at + reach - 0.5).floor() + 1.0)
        };
        for row in span(at.y, reach_px.y, rows) {
            for column in span(at.x, reach_px.x, columns) {
                let offset = DVec2::new(column as f64, row as f64) + 0.5 - at;
                if (offset / reach_px).length_squared() <= 1.0 {
                    visit(row * columns + column);
                }
            }
        }
    }
}

/// A camera with this many cells along the longer side of its image, at most its pixels.
pub(super) fn coarse(camera: &Camera, cells_per_side: u32) -> Camera {
    let [width, height] = [camera.pinhole.width_px, camera.pinhole.height_px];
    let longer = width.max(height);
    let cells = |side: u32| (side * cells_per_side).div_ceil(longer).clamp(1, side);
    camera.resized(cells(width), cells(height))
}
