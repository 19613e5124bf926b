//! Broken splats in files of other programs: a few are left out, and counted, so that they do not cost the whole scene.

use crate::{Result, SplatAsset};
use std::path::Path;

/// Above this share of broken splats a file is refused: it is damaged, or is read as what it is not. Trainers that let some
/// splats diverge leave a few in a thousand.
const SHARE_MAX: f64 = 0.1;

/// Most indices that a message lists.
const LISTED_MAX: usize = 5;

/// The splats of a file that break a rule of [`SplatAsset::validate`].
#[derive(Default)]
pub(crate) struct BrokenSplats {
    /// Their indices, in order.
    found: Vec<usize>,
    /// The first of them and what is wrong with it.
    first: String,
}

impl BrokenSplats {
    /// Adds a splat whose numbers cannot even be stored in an asset; something else stands there in its place.
    pub(crate) fn add(&mut self, splat: usize, what: &str) {
        self.push(splat, format!("splat {splat}: {what}"));
    }

    fn push(&mut self, splat: usize, what: String) {
        if self.found.is_empty() {
            self.first = what;
        }
        self.found.push(splat);
    }

    /// Whether a splat of the asset obeys the rules; counts it if it does not.
    pub(crate) fn is_sound(&mut self, asset: &SplatAsset, splat: usize) -> bool {
        match asset.validate_splat(splat) {
            Ok(()) => true,
            Err(error) => {
                self.push(splat, error.text());
                false
            }
        }
    }

    /// Refuses a file that must have no broken splats, as our own.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] with the first.
    pub(crate) fn refuse(&self, path: &Path) -> Result<()> {
        if self.found.is_empty() { Ok(()) } else { Err(invalid!(path, "{}", self.first)) }
    }

    /// Removes the broken splats from the asset that holds all splats of the file; returns a warning if there were any.
    ///
    /// # Errors
    /// [`crate::Error::Invalid`] if more than a tenth are broken.
    pub(crate) fn leave_out(self, asset: &mut SplatAsset, path: &Path) -> Result<Option<String>> {
        let (broken, total) = (self.found.len(), asset.num_splats());
        if broken == 0 {
            return Ok(None);
        }
        if broken as f64 > SHARE_MAX * total as f64 {
            return Err(invalid!(
                path,
                "{broken} of {total} splats are broken, more than 10 %: the file is damaged, or its header is wrong; {}",
                self.first
            ));
        }
        let mut keep = vec![true; total];
        self.found.iter().for_each(|&splat| keep[splat] = false);
        asset.retain(&keep);
        Ok(Some(self.warning(total)))
    }

    fn warning(&self, total: usize) -> String {
        let (broken, first) = (self.found.len(), &self.first);
        if broken == 1 {
            return format!("1 of {total} splats is broken and left out: {first}");
        }
        let listed: Vec<String> = self.found.iter().take(LISTED_MAX).map(usize::to_string).collect();
        let more = match broken - listed.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        format!("{broken} of {total} splats are broken and left out: {}{more}; {first}", listed.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::tests::fixture;

    fn found_in(asset: &SplatAsset) -> BrokenSplats {
        let mut broken = BrokenSplats::default();
        (0..asset.num_splats()).for_each(|splat| {
            broken.is_sound(asset, splat);
        });
        broken
    }

    #[test]
    fn a_tenth_of_the_splats_may_be_broken_and_no_more() {
        let whole = fixture(100, 1);
        let path = Path::new("scene.ply");
        for (count, expected) in [(1, "1 of 100 splats is broken"), (10, "10 of 100 splats are broken")] {
            let mut asset = whole.clone();
            (0..count).for_each(|i| asset.positions[7 + 3 * i][1] = f32::NAN);
            let broken = found_in(&asset);
            assert!(broken.refuse(path).unwrap_err().to_string().contains("splat 7: position"));
            let warning = broken.leave_out(&mut asset, path).unwrap().unwrap();
            assert!(warning.starts_with(expected) && warning.contains("splat 7: position"), "{warning}");
            assert_eq!(warning.contains("7, 10, 13, 16, 19 and 5 more"), count == 10, "{warning}");
            assert_eq!(asset.num_splats(), 100 - count);
            assert_eq!((asset.positions[6], asset.positions[7]), (whole.positions[6], whole.positions[8]));
            asset.validate().unwrap();
        }
        let mut asset = whole.clone();
        (0..11).for_each(|i| asset.opacities[i] = f32::NAN);
        let error = found_in(&asset).leave_out(&mut asset, path).unwrap_err().to_string();
        assert!(error.contains("11 of 100 splats are broken, more than 10 %"), "{error}");
        // Negative control: a sound asset is not touched.
        let mut asset = whole.clone();
        assert_eq!(found_in(&asset).leave_out(&mut asset, path).unwrap(), None);
        assert!(found_in(&asset).refuse(path).is_ok() && asset == whole);
    }
}
