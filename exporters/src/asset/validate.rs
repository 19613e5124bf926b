//! Rules that every asset obeys, whether it was baked from a model or read from a file.

use crate::math::quaternion;
use crate::math::quaternion::QUATERNION_NORM_TOLERANCE;
use crate::{AssetMap, Error, MAP_SIDE_MAX, Result, SPLATS_MAX, SplatAsset, num_sh_coefficients, quoted};

/// Largest standard deviation, local units.
const SCALE_MAX: f32 = 1e6;

/// Highest SH degree of an asset.
const SH_DEGREE_MAX: u32 = 3;

impl SplatAsset {
    /// Checks everything that writers rely on.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::TooLarge`] for the first offence; the path is empty until [`Error::at`] names a
    /// file.
    pub fn validate(&self) -> Result<()> {
        let invalid = |what: String| Err(Error::invalid("", what));
        let n = self.num_splats();
        if n > SPLATS_MAX {
            return Err(too_large!("", "{n} splats, at most {SPLATS_MAX}"));
        }
        if self.sh_degree > SH_DEGREE_MAX {
            return invalid(format!("SH degree {}, at most {SH_DEGREE_MAX}", self.sh_degree));
        }
        let sh_width = 3 * num_sh_coefficients(self.sh_degree);
        let lengths = [
            ("rotations", self.rotations.len(), n),
            ("scales", self.scales.len(), n),
            ("opacities", self.opacities.len(), n),
            ("maps", self.maps.len(), n),
            ("SH degrees", self.sh_degrees.len(), n),
            ("sh", self.sh.len(), n * sh_width),
        ];
        if let Some((name, found, expected)) = lengths.iter().find(|(_, found, expected)| found != expected) {
            return invalid(format!("{name}: {found} entries for {n} splats, expected {expected}"));
        }
        if !(self.near.is_finite() && self.near >= 0.0) {
            return invalid(format!("near plane {}, expected a finite number, at least 0", self.near));
        }
        let frames =
            [("captureFromLocal", &self.capture_from_local), ("worldFromCapture", &self.world_from_capture)];
        if let Some((name, frame)) = frames.iter().find(|(_, frame)| !frame.is_sound()) {
            let what =
                format!("{name}: {frame:?}, expected finite numbers, a positive scale and a unit quaternion");
            return invalid(what);
        }
        if !self.background.iter().all(|v| (0.0..=1.0).contains(v)) {
            return invalid(format!("background {:?} is not in [0, 1]", self.background));
        }
        (0..n).try_for_each(|splat| self.validate_splat(splat))?;
        self.validate_sh_degrees()?;
        self.validate_maps()?;
        self.validate_cameras()
    }

    /// The rules for the numbers of a single splat, but for its map and its SH degree.
    ///
    /// # Errors
    /// [`Error::Invalid`] for the first offence.
    pub(crate) fn validate_splat(&self, splat: usize) -> Result<()> {
        let offence = |what: String| Err(invalid!("", "splat {splat}: {what}"));
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        let position = self.positions[splat];
        if !finite(&position) {
            return offence(format!("position {position:?} is not finite"));
        }
        let q = self.rotations[splat];
        let norm = quaternion::norm(q.map(f64::from));
        if norm.is_nan() || (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
            return offence(format!("rotation {q:?} is not a unit quaternion"));
        }
        let scales = self.scales[splat];
        if !scales.iter().all(|&s| s > 0.0 && s <= SCALE_MAX) {
            return offence(format!("scales {scales:?} are not in (0, {SCALE_MAX}]"));
        }
        let opacity = self.opacities[splat];
        if !(opacity > 0.0 && opacity <= 1.0) {
            return offence(format!("opacity {opacity} is not in (0, 1]"));
        }
        if !finite(self.sh_of(splat)) {
            return offence("spherical harmonics are not finite".to_owned());
        }
        Ok(())
    }

    fn validate_maps(&self) -> Result<()> {
        let mut next = 0_usize;
        for (splat, map) in self.maps.iter().enumerate() {
            let offence = |what: String| Err(invalid!("", "map of splat {splat}: {what}"));
            if map.rows > MAP_SIDE_MAX || map.cols > MAP_SIDE_MAX {
                let what = format!(
                    "map of splat {splat}: {} x {} texels, at most {MAP_SIDE_MAX} a side",
                    map.rows, map.cols
                );
                return Err(Error::too_large("", what));
            }
            if map.offset_texels as usize != next {
                return offence(format!("offset {}, expected {next}", map.offset_texels));
            }
            if map.num_texels() == 0
                && *map != (AssetMap { offset_texels: map.offset_texels, ..AssetMap::default() })
            {
                return offence(format!("{map:?} is empty, but not 0 x 0 with texel sizes and shift 0"));
            }
            if map.num_texels() > 0 && !map.texel_sizes.iter().all(|&k| k > 0.0 && k.is_finite()) {
                return offence(format!("texel sizes {:?} are not positive", map.texel_sizes));
            }
            next += map.num_texels();
        }
        if next > u32::MAX as usize {
            return Err(too_large!("", "{next} texels, at most {}", u32::MAX));
        }
        if self.texels.len() != 3 * next {
            return Err(invalid!("", "{} texel values, the maps need {}", self.texels.len(), 3 * next));
        }
        match self.texels.iter().position(|t| !(-1.0..=1.0).contains(t)) {
            Some(at) => Err(invalid!("", "texel {}: {} is not in [-1, 1]", at / 3, self.texels[at])),
            None => Ok(()),
        }
    }

    fn validate_cameras(&self) -> Result<()> {
        for camera in &self.cameras {
            let numbers = camera
                .focal_px
                .iter()
                .chain(&camera.principal_px)
                .chain(camera.rotation_rows.as_flattened())
                .chain(&camera.translation);
            if !numbers.into_iter().all(|v| v.is_finite()) {
                return Err(invalid!("", "camera {}: numbers that are not finite", quoted(&camera.name)));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    #[test]
    fn every_broken_rule_is_reported() {
        type Break = fn(&mut SplatAsset);
        let breaks: [(&str, Break); 25] = [
            ("position", |a| a.positions[1][2] = f32::NAN),
            ("rotation", |a| a.rotations[2] = [0.0; 4]),
            ("rotation", |a| a.rotations[2][0] += 0.01),
            ("scales", |a| a.scales[0][1] = 0.0),
            ("scales", |a| a.scales[0][1] = f32::INFINITY),
            ("opacity", |a| a.opacities[3] = 1.5),
            ("opacity", |a| a.opacities[3] = 0.0),
            ("spherical", |a| a.sh[40] = f32::NEG_INFINITY),
            ("sh:", |a| a.sh.truncate(5)),
            ("SH degrees:", |a| a.sh_degrees.truncate(6)),
            ("SH degree", |a| a.sh_degrees[0] = 2),
            ("SH degree", |a| a.sh_degrees[0] = 0),
            ("no splat has more", |a| {
                a.sh_degrees.fill(0);
                a.sh.chunks_exact_mut(12).for_each(|sh| sh[3..].fill(0.0));
            }),
            ("offset", |a| a.maps[2].offset_texels += 1),
            ("texel sizes", |a| a.maps[0].texel_sizes[0] = -1.0),
            ("texel sizes", |a| a.maps[0].texel_sizes[1] = f32::INFINITY),
            ("texel", |a| a.texels[9] = 1.01),
            ("texel values", |a| a.texels.truncate(9)),
            ("captureFromLocal", |a| a.capture_from_local.scale = 0.0),
            ("worldFromCapture", |a| a.world_from_capture.rotation[1] = 0.1),
            ("near", |a| a.near = -1.0),
            ("empty", |a| a.maps[1].cols = 3),
            ("empty", |a| a.maps[1].texel_sizes[1] = 0.1),
            ("empty", |a| a.maps[1].shift[0] = 1),
            ("background", |a| a.background[2] = f32::NAN),
        ];
        for (word, change) in breaks {
            let mut asset = fixture(7, 1);
            change(&mut asset);
            let error = asset.validate().unwrap_err().to_string();
            assert!(error.contains(word), "{word}: {error}");
        }
        let mut asset = fixture(7, 1);
        asset.maps[0].rows = MAP_SIDE_MAX + 1;
        assert!(matches!(asset.validate(), Err(Error::TooLarge { .. })));
    }
}
