//! A file belongs to one view. Where the names of several lead to it, the one that fits best has it; where several fit
//! equally well, none has: a photo with the pose of another spoils more than one photo less.

use super::photo_folder::Match;
use super::source::first_of;
use crate::text::quoted;
use std::collections::{BTreeMap, BTreeSet};

/// A view whose file is that of another, or may be.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Loser {
    /// Index among the claims.
    pub index: usize,
    /// For people.
    pub words: String,
}

/// Of files that were found, those that belong to others. Equal names claim nothing of each other.
pub(crate) fn losers(claims: &[&Match]) -> Vec<Loser> {
    // On disks that ignore case, paths that differ in it are one file.
    let mut by_path = BTreeMap::<String, Vec<usize>>::new();
    for (index, claim) in claims.iter().enumerate() {
        by_path.entry(claim.path.to_string_lossy().to_lowercase()).or_default().push(index);
    }
    let mut losers = Vec::new();
    for indices in by_path.into_values().filter(|indices| indices.len() > 1) {
        let mut by_file = BTreeMap::<_, Vec<usize>>::new();
        for index in indices {
            let path = &claims[index].path;
            by_file.entry(path.canonicalize().unwrap_or_else(|_| path.clone())).or_default().push(index);
        }
        for (file, indices) in by_file {
            let misfit = |index: &usize| {
                let claim = claims[*index];
                let is_own_name = claim.path.file_name() == file.file_name();
                let mut misfit = claim.misfit;
                misfit.case |= !is_own_name;
                misfit
            };
            let Some(best) = indices.iter().map(misfit).min() else { continue };
            let fitting: BTreeSet<&str> = indices
                .iter()
                .filter(|index| misfit(index) == best)
                .map(|index| &*claims[*index].asked)
                .collect();
            let owner = fitting.first().copied().filter(|_| fitting.len() == 1);
            for index in indices.into_iter().filter(|index| Some(&*claims[*index].asked) != owner) {
                let asked = &*claims[index].asked;
                let shown = claims[index].path.file_name().unwrap_or_default().to_string_lossy();
                let other = owner.or_else(|| fitting.iter().copied().find(|name| *name != asked));
                let (is, other) =
                    (if owner.is_some() { "is" } else { "may as well be" }, other.unwrap_or(""));
                let words = format!("{} ({} {is} that of {})", quoted(asked), quoted(&shown), quoted(other));
                losers.push(Loser { index, words });
            }
        }
    }
    losers.sort_by_key(|loser| loser.index);
    losers
}

/// The first few, for people.
pub(crate) fn list(losers: &[Loser]) -> String {
    first_of(losers.iter().map(|loser| loser.words.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::folder::CaptureFolder;

    /// The names of which no file of the folder is their own.
    fn lost(files: &[&str], names: &[&str]) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|name| std::fs::write(folder.path().join(name), b"").unwrap());
        let photos = CaptureFolder::new(folder.path(), None, false).unwrap().photos("");
        let found: Vec<Match> = names.iter().filter_map(|name| photos.find(name).unwrap()).collect();
        assert_eq!(found.len(), names.len(), "all are found");
        losers(&found.iter().collect::<Vec<_>>()).into_iter().map(|loser| loser.words).collect()
    }

    #[test]
    fn a_file_belongs_to_the_name_that_fits_best_and_to_none_of_equals() {
        let one = |words: &str| vec![words.to_owned()];
        assert_eq!(lost(&["a.jpg"], &["a.png", "a.jpg"]), one(r#""a.png" ("a.jpg" is that of "a.jpg")"#));
        assert_eq!(
            lost(&["IMG.jpg"], &["IMG.jpg", "img.jpg"]),
            one(r#""img.jpg" ("IMG.jpg" is that of "IMG.jpg")"#)
        );
        assert_eq!(lost(&["a.webp"], &["A.jpg", "a.jpg"]), one(r#""A.jpg" ("a.webp" is that of "a.jpg")"#));
        assert_eq!(
            lost(&["a.webp"], &["a.png", "a.jpg"]),
            [
                r#""a.png" ("a.webp" may as well be that of "a.jpg")"#,
                r#""a.jpg" ("a.webp" may as well be that of "a.png")"#
            ]
        );
        assert_eq!(lost(&["1.png"], &["left/1.png", "right/1.png"]).len(), 2);
        assert_eq!(lost(&["1.png"], &["left/1.png", "1.png", "right/1.png"]).len(), 2);
        // Negative controls: files enough, and one name twice.
        assert!(lost(&["a.jpg", "A.jpg", "b.png"], &["A.jpg", "a.jpg", "b.jpg"]).is_empty());
        assert!(lost(&["a.webp"], &["a.png", "a.png"]).is_empty());
    }
}
