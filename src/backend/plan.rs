//! The plan of a density-control step: decided by the trainer, carried out by every backend in the same way.

use crate::Result;
use crate::constants::{SH_DEGREE_MAX, sh_coefficients};
use crate::model::{Model, ModelSize, TextureMap};

/// The texel grid of a map along an axis, at its own density, twice or half of it. Outside of the map texels and first
/// moments are zero, and second moments are those of the nearest texel, so that new texels start with steps of the usual
/// size. A map without texels has zeros everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grid {
    /// The texels of the map, for crops, pads and shifts.
    Same,
    /// Each texel is repeated, with half the edge.
    Finer,
    /// Means of two texels, with twice the edge. Of two texels, one may be outside the map: the mean is then the other.
    Coarser,
}

impl Grid {
    /// Texel size of this grid divided by that of the map.
    pub fn texel_ratio(self) -> f32 {
        match self {
            Self::Same => 1.0,
            Self::Finer => 0.5,
            Self::Coarser => 2.0,
        }
    }
}

/// The change of one map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MapChange {
    /// The map stays the same.
    Keep,
    /// A window of the map on its own texel grid, or along each axis on one twice as fine or as coarse. On its own grid no
    /// texel moves on the surfel.
    Regrid {
        /// Grid that the window is cut from, along u and v.
        grids: [Grid; 2],
        /// New number of rows, along u; 0: untextured.
        rows: u16,
        /// New number of columns, along v; 0: untextured.
        cols: u16,
        /// Row of the grid that becomes row 0; on a coarser grid, the first of the two rows of the map whose mean becomes
        /// row 0. May be negative.
        first_row: i32,
        /// As `first_row`, along v.
        first_col: i32,
        /// Shift of the new map on the new splat, see [`TextureMap::shift`].
        shift: [i16; 2],
        /// Factors of the texels' first and second moments.
        moment_scale: [f32; 2],
    },
    /// Bilinear resampling to a new size about the new splat's centre. Texels and moments outside the map are zero; the
    /// moments of the splat's other parameters do not change.
    Resample {
        /// New number of rows, along u.
        rows: u16,
        /// New number of columns, along v.
        cols: u16,
        /// New edges of a texel along u and v, local units.
        texel_sizes: [f32; 2],
        /// Centre of the new splat, in texels of the old map from the centre of the old splat.
        shift_texels: [f32; 2],
        /// Factors of the texels' first and second moments after resampling. The gradient of a texel shrinks with its
        /// area, so a map of twice as many texels per axis takes `[1.0 / 4.0, 1.0 / 16.0]`.
        moment_scale: [f32; 2],
    },
}

impl MapChange {
    /// Whether the new map is coarser than the old along an axis.
    pub fn is_coarser(&self) -> bool {
        matches!(self, Self::Regrid { grids, .. } if grids.contains(&Grid::Coarser))
    }

    /// The map that this change makes of `old`, yet to be placed.
    pub fn applied_to(&self, old: &TextureMap) -> TextureMap {
        match *self {
            Self::Keep => *old,
            Self::Resample { rows, cols, texel_sizes, .. } => TextureMap::centred(rows, cols, texel_sizes),
            Self::Regrid { grids, rows, cols, shift, .. } => {
                let texel_sizes = [0, 1].map(|axis| old.texel_sizes[axis] * grids[axis].texel_ratio());
                TextureMap { shift, ..TextureMap::centred(rows, cols, texel_sizes) }
            }
        }
    }
}

/// New values for some parameters of a splat. Their first moments become zero, their second moments stay those of the
/// source, so that steps start small and soon reach the usual size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplatEdit {
    /// Index of the splat in the new model.
    pub splat: u32,
    /// Centre, local frame.
    pub position: [f32; 3],
    /// Logarithms of the standard deviations, local units.
    pub log_scales: [f32; 2],
    /// Opacity before the sigmoid.
    pub opacity_logit: f32,
}

/// A density-control step, decided on the host and carried out by the backend on the flushed model, the one returned
/// by [`Backend::read_flushed`](super::Backend::read_flushed).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DensityPlan {
    /// For each splat of the new model, the index of its source. `[n_new]`
    pub sources: Vec<u32>,
    /// For each splat of the new model, the change of its source's map. `[n_new]`
    pub maps: Vec<MapChange>,
    /// For each splat of the new model, its SH degree; empty: those of the sources. New coefficients and their first moments
    /// are 0; their second moments are those of DC, so that steps start small and soon reach the usual size. `[n_new]`
    pub sh_degrees: Vec<u8>,
    /// New parameters of splats that differ from their source, by ascending index.
    pub edits: Vec<SplatEdit>,
}

impl DensityPlan {
    /// The degrees of the new splats, from those of the old.
    pub fn new_sh_degrees(&self, old: &[u8]) -> Vec<u8> {
        if self.sh_degrees.is_empty() {
            return self.sources.iter().map(|&s| old[s as usize]).collect();
        }
        self.sh_degrees.clone()
    }

    /// What `model` is made of after the plan.
    pub fn size_after(&self, model: &Model) -> ModelSize {
        let maps = self.sources.iter().zip(&self.maps);
        let texels = maps
            .map(|(&source, change)| change.applied_to(&model.textures.maps[source as usize]).num_texels());
        let degrees = self.new_sh_degrees(model.splats.sh_degrees());
        texels.zip(degrees).fold(ModelSize::default(), |size, (texels, degree)| ModelSize {
            splats: size.splats + 1,
            maps: size.maps + usize::from(texels > 0),
            texels: size.texels + texels,
            sh_coefficients: size.sh_coefficients + sh_coefficients(degree.into()),
        })
    }

    /// Checks the plan against a model of `num_splats` splats.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] naming the first inconsistency.
    pub fn check(&self, num_splats: usize) -> Result<()> {
        if self.sources.len() != self.maps.len() {
            return Err(usage!(
                "density-control plan: {} sources but {} map changes",
                self.sources.len(),
                self.maps.len()
            ));
        }
        if let Some(at) = self.sources.iter().position(|&s| s as usize >= num_splats) {
            return Err(usage!(
                "density-control plan: source {} of new splat {at} is not one of the {num_splats} splats",
                self.sources[at]
            ));
        }
        if !self.sh_degrees.is_empty() && self.sh_degrees.len() != self.sources.len() {
            return Err(usage!(
                "density-control plan: {} sources but {} SH degrees",
                self.sources.len(),
                self.sh_degrees.len()
            ));
        }
        if let Some(at) = self.sh_degrees.iter().position(|&d| u32::from(d) > SH_DEGREE_MAX) {
            return Err(usage!(
                "density-control plan: SH degree {} of new splat {at}, expected at most {SH_DEGREE_MAX}",
                self.sh_degrees[at]
            ));
        }
        for (at, map) in self.maps.iter().enumerate() {
            if let MapChange::Resample { moment_scale, .. } | MapChange::Regrid { moment_scale, .. } = map
                && !moment_scale.iter().all(|f| f.is_finite() && *f >= 0.0)
            {
                return Err(usage!(
                    "density-control plan: moment scale {moment_scale:?} of new splat {at}, expected finite numbers \
                     of at least 0"
                ));
            }
            if let MapChange::Regrid { rows, cols, .. } = map
                && (*rows == 0) != (*cols == 0)
            {
                return Err(usage!(
                    "density-control plan: a map of {rows} x {cols} texels for new splat {at}, expected texels along \
                     both axes or none"
                ));
            }
        }
        let mut next = 0;
        for edit in &self.edits {
            let values = edit.position.iter().chain(&edit.log_scales).chain([&edit.opacity_logit]);
            if edit.splat < next || edit.splat as usize >= self.sources.len() {
                return Err(usage!(
                    "density-control plan: edits of {} new splats must be in ascending order, found splat {} where at \
                     least {next} was expected",
                    self.sources.len(),
                    edit.splat
                ));
            }
            if !values.into_iter().all(|v| v.is_finite()) {
                return Err(usage!("density-control plan: edit {edit:?} has non-finite values"));
            }
            next = edit.splat + 1;
        }
        Ok(())
    }
}
