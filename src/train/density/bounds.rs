//! Valid ranges of the settings of density control.

use super::settings::DensityConfig;

impl DensityConfig {
    /// Checks all settings.
    ///
    /// # Errors
    /// The first setting out of its range: its name, what was found and what is expected.
    pub fn check(&self) -> Result<(), String> {
        let [split_start, split_end] = self.split_texels;
        let [floor_start, floor_end] = self.opacity_floor.unwrap_or_default();
        // Name, value, lower bound, upper bound, and whether the lower bound itself is allowed.
        let bounds = [
            ("quantile", self.quantile, 0.0, 1.0, true),
            ("min-texel-px", self.min_texel_px, 0.0, 1e3, false),
            ("alpha-texture", self.alpha_texture, 0.0, 0.99, false),
            ("coarsen-below", self.coarsen_below, 0.0, 1e3, true),
            ("sh-below", self.sh_below, 0.0, 1e3, true),
            ("sh-raise", self.sh_raise, 0.0, 1e3, true),
            ("need-db", self.need_db, 0.0, 100.0, true),
            ("prune-db", self.prune_db, 0.0, 100.0, true),
            ("price-fragments", self.price_fragments, 0.0, 1e3, true),
            ("overshoot", self.overshoot, 1.0, 1e3, true),
            ("floor-db", self.floor_db, 0.0, 200.0, true),
            ("grow-by-axis", self.grow_by_axis, 0.0, 1e6, true),
            ("split-texels", split_start, 0.0, 1e6, false),
            ("split-texels", split_end, 0.0, 1e6, false),
            ("prune-contribution", self.prune_contribution, 0.0, 1e3, true),
            ("prune-area", self.prune_area, 0.0, 1e3, true),
            ("opacity-floor", floor_start, 0.0, 0.99, true),
            ("opacity-floor", floor_end, 0.0, 0.99, true),
        ];
        for (key, found, least, most, with_least) in bounds {
            let high_enough = if with_least { found >= least } else { found > least };
            if !(high_enough && found <= most) {
                let from = if with_least { "from" } else { "above" };
                return Err(format!(
                    "density.{key}: found {found}, expected a number {from} {least} to {most}"
                ));
            }
        }
        if self.interval == Some(0) {
            return Err("density.interval: found 0, expected at least 1 step".to_owned());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_bounds_are_named() {
        assert_eq!(DensityConfig::default().check(), Ok(()));
        type Change = fn(&mut DensityConfig);
        let wrong: [(&str, Change); 7] = [
            ("quantile: found 1.2", |c| c.quantile = 1.2),
            ("quantile: found NaN", |c| c.quantile = f64::NAN),
            ("min-texel-px: found 0", |c| c.min_texel_px = 0.0),
            ("alpha-texture: found 2", |c| c.alpha_texture = 2.0),
            ("split-texels: found -5", |c| c.split_texels = [64.0, -5.0]),
            ("opacity-floor: found inf", |c| c.opacity_floor = Some([f64::INFINITY, 0.0])),
            ("interval: found 0", |c| c.interval = Some(0)),
        ];
        for (what, change) in wrong {
            let mut config = DensityConfig::default();
            change(&mut config);
            let error = config.check().unwrap_err();
            assert!(error.contains(what), "{error}");
        }
    }
}
