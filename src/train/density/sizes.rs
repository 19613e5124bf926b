//! Which sizes maps may have.

use super::geometry::even_texels;

/// How the sizes of maps are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapRule {
    /// No splat has a map.
    None,
    /// Every map has this side, in texels.
    Fixed(u16),
    /// Every map has its own size, refined and coarsened as needed.
    Adaptive,
}

/// Bounds of a map.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sizes {
    /// Half extents of the map, local units.
    pub extents: [f64; 2],
    /// Edge of the finest texel allowed, local units.
    pub finest: f64,
    /// Largest side whatever the ceiling, in texels.
    pub cap: u16,
}

impl Sizes {
    /// Rows and columns that cover the extents with texels of these edges.
    pub fn texels(&self, texel_sizes: [f64; 2]) -> [u32; 2] {
        [0, 1].map(|axis| even_texels(self.extents[axis], texel_sizes[axis]))
    }

    /// Whether a map of this size is within `ceiling` and cap.
    pub fn fits(&self, texels: [u32; 2], ceiling: u16) -> bool {
        texels[0].max(texels[1]) <= u32::from(ceiling.min(self.cap))
    }

    /// Whether the map covers anything.
    pub fn has_support(&self) -> bool {
        self.extents[0] > 0.0 && self.extents[1] > 0.0
    }
}
