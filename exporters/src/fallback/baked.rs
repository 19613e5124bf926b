//! Splats for formats without textures or transforms: in the world frame, with maps averaged into the base colour.

use crate::math::quaternion;
use crate::math::sh::Turn;
use crate::{SplatAsset, Transform};

/// A splat in the world frame.
pub struct Baked {
    pub position: [f64; 3],
    /// `world_from_surfel`, wxyz.
    pub rotation: [f32; 4],
    /// Standard deviations, world units.
    pub scales: [f64; 2],
    /// In (0, 1].
    pub opacity: f32,
    /// SH coefficients. `[(degree + 1)^2, 3]`
    pub sh: Vec<f64>,
}

/// Turns the splats of an asset into [`Baked`] ones.
pub struct Baker<'a> {
    asset: &'a SplatAsset,
    /// `world_from_local`.
    frame: Transform,
    turn: Option<Turn>,
}

impl<'a> Baker<'a> {
    /// A baker for the splats of an asset.
    pub fn new(asset: &'a SplatAsset) -> Self {
        Self::in_frame(asset, asset.world_from_local())
    }

    /// A baker into another frame.
    pub fn in_frame(asset: &'a SplatAsset, frame: Transform) -> Self {
        Self { asset, frame, turn: (!frame.is_upright()).then(|| Turn::new(frame.rotation)) }
    }

    /// The centre of a splat in the world frame.
    pub fn position(&self, splat: usize) -> [f64; 3] {
        self.frame.transform_point(self.asset.positions[splat])
    }

    pub fn splat(&self, splat: usize) -> Baked {
        let (asset, frame) = (self.asset, &self.frame);
        let mut rotation = asset.rotations[splat];
        let mut sh: Vec<f64> = asset.sh_of(splat).iter().map(|&c| c.into()).collect();
        if let Some(turn) = &self.turn {
            let turned = quaternion::product(frame.rotation, rotation.map(f64::from));
            let norm = quaternion::norm(turned);
            rotation = turned.map(|v| (v / norm) as f32);
            sh = turn.apply(asset.sh_of(splat));
        }
        // Degree 0 is the same in all directions.
        for (dc, baked) in sh.iter_mut().zip(asset.untextured_dc(splat)) {
            *dc = baked.into();
        }
        Baked {
            position: self.position(splat),
            rotation,
            scales: asset.scales[splat].map(|s| f64::from(s) * frame.scale),
            opacity: asset.opacities[splat],
            sh,
        }
    }
}
