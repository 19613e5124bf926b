//! A splat as merging sees it: its plane, its falloff, its colours, and what changes of them cost.

use crate::constants::SH_0;
use crate::model::{Model, TextureMap, texel_value};
use crate::train::density::{opacity, sigmas};
use crate::train::prune::costs::SplatCosts;
use crate::train::prune::offers::params_of;
use glam::{DMat3, DQuat, DVec2, DVec3};

/// A splat, or several that have become one.
#[derive(Clone, Debug)]
pub struct Part {
    /// The splats it is made of.
    pub members: Vec<u32>,
    /// Centre, local frame.
    pub position: DVec3,
    /// Rotation local_from_surfel: axes u, v and the normal as columns.
    pub axes: DMat3,
    /// Standard deviations along u and v, local units.
    pub sigmas: [f64; 2],
    /// Opacity after activation.
    pub opacity: f64,
    /// SH coefficients up to its degree. `[(sh_degree + 1)^2 * 3]`
    pub sh: Vec<f64>,
    /// SH degree.
    pub sh_degree: u8,
    /// Size and place of its map; the offset means nothing.
    pub map: TextureMap,
    /// Residuals of its texels after activation. `[rows * cols, 3]`
    pub residuals: Vec<f64>,
    /// What changes of it cost; `None`: unknown, so that it does not merge.
    pub costs: Option<SplatCosts>,
    /// Width of a pixel at the splat in the nearest view, local units.
    pub pixel: f64,
    /// Mean squared change of the images where it takes the place of its members.
    pub cost: f64,
}

impl Part {
    /// A splat of a model.
    pub fn of(model: &Model, splat: usize, costs: Option<SplatCosts>, pixel: f64) -> Self {
        let splats = &model.splats;
        let p = &splats.positions[3 * splat..][..3];
        let q = &splats.quaternions[4 * splat..][..4];
        let [w, x, y, z] = [q[0], q[1], q[2], q[3]].map(f64::from);
        let map = model.textures.maps[splat];
        Self {
            members: vec![splat as u32],
            position: DVec3::new(p[0].into(), p[1].into(), p[2].into()),
            axes: DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize()),
            sigmas: sigmas(model, splat),
            opacity: opacity(model, splat),
            sh: splats.sh_of(splat).iter().map(|&c| c.into()).collect(),
            sh_degree: splats.sh_degrees()[splat],
            map,
            residuals: model.textures.texels[map.floats()].iter().map(|&t| texel_value(t.into())).collect(),
            costs,
            pixel,
            cost: 0.0,
        }
    }

    /// Opacity times area, the weight of the part in a mean.
    pub fn mass(&self) -> f64 {
        self.opacity * self.sigmas[0] * self.sigmas[1]
    }

    /// Place of a point in the surfel's plane: along u and v, from the centre.
    pub fn in_plane(&self, point: DVec3) -> DVec2 {
        let offset = point - self.position;
        DVec2::new(offset.dot(self.axes.x_axis), offset.dot(self.axes.y_axis))
    }

    /// The point at a place in the surfel's plane.
    pub fn point(&self, at: DVec2) -> DVec3 {
        self.position + at.x * self.axes.x_axis + at.y * self.axes.y_axis
    }

    /// Falloff of the Gaussian at a place in the plane.
    pub fn falloff(&self, at: DVec2) -> f64 {
        (-0.5 * ((at.x / self.sigmas[0]).powi(2) + (at.y / self.sigmas[1]).powi(2))).exp()
    }

    /// Colour at a place in the plane, of SH degree 0.
    pub fn colour(&self, at: DVec2) -> [f64; 3] {
        let residual = self.residual(at);
        [0, 1, 2].map(|channel| 0.5 + SH_0 * self.sh[channel] + residual[channel])
    }

    /// Residual of the map at a place in the plane, sampled bilinearly with zeros outside.
    fn residual(&self, at: DVec2) -> [f64; 3] {
        let (rows, cols) = (i64::from(self.map.rows), i64::from(self.map.cols));
        if rows == 0 {
            return [0.0; 3];
        }
        let origin = self.map.origin().map(f64::from);
        let row = at.x / f64::from(self.map.texel_sizes[0]) + origin[0];
        let col = at.y / f64::from(self.map.texel_sizes[1]) + origin[1];
        let (first_row, first_col) = (row.floor(), col.floor());
        let mut sum = [0.0; 3];
        for (i, by_row) in [(first_row, 1.0 - row + first_row), (first_row + 1.0, row - first_row)] {
            for (j, by_col) in [(first_col, 1.0 - col + first_col), (first_col + 1.0, col - first_col)] {
                if (0..rows).contains(&(i as i64)) && (0..cols).contains(&(j as i64)) {
                    let texel = 3 * (i as i64 * cols + j as i64) as usize;
                    let values = &self.residuals[texel..texel + 3];
                    sum.iter_mut().zip(values).for_each(|(s, value)| *s += by_row * by_col * value);
                }
            }
        }
        sum
    }

    /// Parameters that it holds.
    pub fn params(&self) -> usize {
        params_of(self.sh_degree, self.map.num_texels())
    }
}
