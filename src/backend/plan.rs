//! What becomes of splats and their maps in a density-control step: decided by the trainer, carried out alike by every
//! backend.

use crate::{Error, Result};

/// The texel grid of a map, seen as it is or at twice or half its density. Outside of it texels and first
/// moments are zero and second moments those of the nearest texel of the grid, so that a texel that comes
/// into being starts with steps of the usual size. A map without texels has zeros everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// The texels as they are: crop, pad, shift.
    Same,
    /// Each texel twice along each axis, texels of half the edge.
    Finer,
    /// Means of 2 x 2 texels, of twice the edge. Sizes that are no multiple of four are first padded evenly
    /// by replication, so that the result is even and has the same centre.
    Coarser,
}

impl Grid {
    /// Rows (or columns) that a map of `texels` rows has on this grid.
    pub fn texels(self, texels: u16) -> u16 {
        match self {
            Self::Same => texels,
            Self::Finer => texels.saturating_mul(2),
            Self::Coarser => texels.div_ceil(4).saturating_mul(2),
        }
    }

    /// Edge of a texel on this grid over its edge on the map.
    pub fn texel_ratio(self) -> f32 {
        match self {
            Self::Same => 1.0,
            Self::Finer => 0.5,
            Self::Coarser => 2.0,
        }
    }
}

/// What becomes of one map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapChange {
    /// Stays as it is.
    Keep,
    /// A window of the map on its own texel grid or one twice as fine or coarse: no texel leaves its place
    /// on the surfel beyond what the grid asks for. See [`Grid`].
    Regrid {
        /// Grid that the window is cut from.
        grid: Grid,
        /// New texels along u; 0: untextured.
        rows: u16,
        /// New texels along v; 0: untextured.
        cols: u16,
        /// Row of that grid that becomes row 0; may be negative.
        first_row: i32,
        /// Column of that grid that becomes column 0; may be negative.
        first_col: i32,
        /// Factors of the texels' first and second moments.
        moment_scale: [f32; 2],
    },
    /// Bilinear resampling to a new size about the centre or a place beside it; texels and moments outside are zero. The
    /// moments of the splat's other parameters stay as they are.
    Resample {
        /// New texels along u.
        rows: u16,
        /// New texels along v.
        cols: u16,
        /// New edge of a texel, local units.
        texel_size: f32,
        /// Place of the new map's centre in the old one, texels of the old map from its centre.
        shift_texels: [f32; 2],
        /// Factors of the texels' first and second moments, applied after the resampling:
        /// `[1.0, 1.0]` is the resampling alone. A gradient by a texel shrinks with its area, so a map
        /// of twice as many texels per axis takes `[1.0 / 4.0, 1.0 / 16.0]`.
        moment_scale: [f32; 2],
    },
}

/// New values for some parameters of a splat, which starts anew there: its first moments become zero, its
/// second moments stay those of its source, so that its first steps are small and soon of the usual size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatEdit {
    /// Index in the new model.
    pub splat: u32,
    /// Centre, local frame.
    pub position: [f32; 3],
    /// Logarithms of the standard deviations.
    pub log_scales: [f32; 2],
    /// Opacity before the sigmoid.
    pub opacity_logit: f32,
}

/// A density-control step, decided on the host and applied alike by every backend. It is applied to the
/// flushed model: the one that [`Backend::read_flushed`](super::Backend::read_flushed) gives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensityPlan {
    /// For each splat of the new model the splat it comes from. `[n_new]`
    pub sources: Vec<u32>,
    /// For each splat of the new model what becomes of its source's map. `[n_new]`
    pub maps: Vec<MapChange>,
    /// Splats that get other parameters than their source has, ascending.
    pub edits: Vec<SplatEdit>,
}

impl DensityPlan {
    /// Checks the plan against a model of `num_splats` splats.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the first inconsistency.
    pub fn check(&self, num_splats: usize) -> Result<()> {
        if self.sources.len() != self.maps.len() {
            return Err(Error::Usage(format!(
                "density-control plan: {} sources but {} map changes",
                self.sources.len(),
                self.maps.len()
            )));
        }
        if let Some(at) = self.sources.iter().position(|&s| s as usize >= num_splats) {
            return Err(Error::Usage(format!(
                "density-control plan: source {} of new splat {at} is not one of the {num_splats} splats",
                self.sources[at]
            )));
        }
        for (at, map) in self.maps.iter().enumerate() {
            if let MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. } = map
                && !moment_scale.iter().all(|f| f.is_finite() && *f >= 0.0)
            {
                return Err(Error::Usage(format!(
                    "density-control plan: moment scale {moment_scale:?} of new splat {at}, expected finite numbers \
                     of at least 0"
                )));
            }
            if let MapChange::Regrid { rows, cols, .. } = map
                && (*rows == 0) != (*cols == 0)
            {
                return Err(Error::Usage(format!(
                    "density-control plan: a map of {rows} x {cols} texels for new splat {at}, expected texels along \
                     both axes or along none"
                )));
            }
        }
        let mut next = 0;
        for edit in &self.edits {
            let values = edit.position.iter().chain(&edit.log_scales).chain([&edit.opacity_logit]);
            if edit.splat < next || edit.splat as usize >= self.sources.len() {
                return Err(Error::Usage(format!(
                    "density-control plan: edits of {} new splats must name each once and in order, found {} where at \
                     least {next} was expected",
                    self.sources.len(),
                    edit.splat
                )));
            }
            if !values.into_iter().all(|v| v.is_finite()) {
                return Err(Error::Usage(format!(
                    "density-control plan: edit {edit:?} has values that are not finite"
                )));
            }
            next = edit.splat + 1;
        }
        Ok(())
    }
}
