//! The SH degree of each splat. The arrays of an asset hold coefficients up to the largest degree in use; those above a
//! splat's own degree are 0.

use crate::{Error, Result, SplatAsset, num_sh_coefficients};

impl SplatAsset {
    /// SH coefficients of a splat up to its own degree. `[(degree + 1)^2, 3]`
    pub fn own_sh_of(&self, splat: usize) -> &[f32] {
        let all = self.sh_of(splat);
        &all[..(3 * num_sh_coefficients(self.sh_degrees[splat].into())).min(all.len())]
    }

    /// Makes `sh_degree` the largest degree in use, after splats were removed.
    pub fn fit_sh_degree(&mut self) {
        let most = self.sh_degrees.iter().max().map_or(0, |&degree| degree.into());
        if most < self.sh_degree {
            let [old, new] = [self.sh_degree, most].map(|degree| 3 * num_sh_coefficients(degree));
            self.sh = self.sh.chunks_exact(old).flat_map(|sh| &sh[..new]).copied().collect();
            self.sh_degree = most;
        }
    }

    /// Drops all coefficients above a degree.
    pub fn limit_sh_degree(&mut self, most: u32) {
        self.sh_degrees.iter_mut().for_each(|degree| *degree = u32::from(*degree).min(most) as u8);
        self.fit_sh_degree();
    }

    /// Stores the degrees of splats whose coefficients were read with zeros above them. `[n]`
    ///
    /// # Errors
    /// [`Error::Invalid`] for a degree above that of the arrays, or a coefficient above its splat's degree that is not 0.
    pub(crate) fn store_sh_degrees(&mut self, degrees: Vec<u8>) -> Result<()> {
        let width = 3 * num_sh_coefficients(self.sh_degree);
        for (splat, (sh, &degree)) in self.sh.chunks_exact_mut(width).zip(&degrees).enumerate() {
            let own = 3 * num_sh_coefficients(degree.into());
            let above = sh.get_mut(own..).filter(|above| above.iter().all(|c| *c == 0.0));
            // Without the sign that a change of the frame may have left.
            above.ok_or_else(|| wrong_degree(splat, degree, self.sh_degree))?.fill(0.0);
        }
        self.sh_degrees = degrees;
        Ok(())
    }

    /// Checks that degrees and coefficients fit each other; their numbers were checked before.
    pub(crate) fn validate_sh_degrees(&self) -> Result<()> {
        let width = 3 * num_sh_coefficients(self.sh_degree);
        for (splat, (sh, &degree)) in self.sh.chunks_exact(width).zip(&self.sh_degrees).enumerate() {
            let above = sh.get(3 * num_sh_coefficients(degree.into())..);
            if !above.is_some_and(|above| above.iter().all(|c| *c == 0.0)) {
                return Err(wrong_degree(splat, degree, self.sh_degree));
            }
        }
        match self.sh_degrees.iter().max() {
            Some(&most) if u32::from(most) != self.sh_degree => {
                Err(invalid!("", "SH of degree {}, but no splat has more than {most}", self.sh_degree))
            }
            _ => Ok(()),
        }
    }
}

fn wrong_degree(splat: usize, degree: u8, most: u32) -> Error {
    let what = format!(
        "splat {splat}: SH degree {degree}, expected at most {most} and coefficients of 0 above the splat's own"
    );
    Error::invalid("", what)
}

#[cfg(test)]
mod tests {
    use crate::asset::tests::fixture;

    #[test]
    fn arrays_shrink_to_the_largest_degree_in_use() {
        let mut asset = fixture(12, 3);
        let keep: Vec<bool> = asset.sh_degrees.iter().map(|&degree| degree < 3).collect();
        let kept: Vec<Vec<f32>> = (0..12).filter(|&i| keep[i]).map(|i| asset.own_sh_of(i).to_vec()).collect();
        asset.retain(&keep);
        asset.validate().unwrap();
        assert_eq!((asset.sh_degree, asset.sh.len()), (1, 12 * kept.len()));
        for (i, own) in kept.iter().enumerate() {
            assert_eq!(asset.own_sh_of(i), own);
        }
        asset.retain(&vec![false; kept.len()]);
        assert_eq!((asset.sh_degree, asset.num_splats()), (0, 0));
        asset.validate().unwrap();
    }

    #[test]
    fn degrees_that_do_not_fit_their_coefficients_are_refused() {
        let asset = fixture(5, 2);
        assert_eq!(asset.sh_degrees, [2, 2, 1, 2, 0]);
        let stored = |degrees: [u8; 5]| {
            let mut read = asset.clone();
            read.store_sh_degrees(degrees.to_vec()).map(|()| read)
        };
        assert_eq!(stored([2, 2, 1, 2, 0]).unwrap(), asset);
        assert_eq!(stored([2, 2, 2, 2, 0]).unwrap().sh_degrees[2], 2, "zeros do not tell the degree");
        for degrees in [[2, 1, 1, 2, 0], [2, 2, 0, 2, 0], [3, 2, 1, 2, 0], [255; 5]] {
            let error = stored(degrees).unwrap_err().to_string();
            assert!(error.contains("SH degree"), "{error}");
        }
    }
}
