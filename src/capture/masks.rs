//! Which way up a mask is, where the EXIF data of its photo ask for a turn. Masks that a program wrote for the stored pixels
//! lie as these do, masks painted over the photo in an image editor, which obeys EXIF data, as the photo once turned. The
//! sides of a mask tell, or else those of the other masks, since one tool makes all of a capture; failing that, a mask is
//! taken to lie as its photo is taken.

use super::photos::{PhotoHeader, swaps_sides};
use super::source::first_names;
use crate::Report;
use image::metadata::Orientation;

/// A view with a mask.
#[derive(Clone, Copy)]
pub(crate) struct Masked<'a> {
    pub name: &'a str,
    pub photo: PhotoHeader,
    /// The turn with which the photo is taken.
    pub turn: Orientation,
    pub mask: PhotoHeader,
}

/// The pixels that a mask was made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Made {
    ForStored,
    ForTurned,
}

impl Masked<'_> {
    fn is_asked_to_turn(&self) -> bool {
        self.photo.turn != Orientation::NoTransforms
    }

    /// What the sides of the mask tell.
    fn by_sides(&self) -> Option<Made> {
        let ((w, h), (mask_w, mask_h)) = (self.photo.size, self.mask.size);
        let tell = swaps_sides(self.photo.turn) && w != h;
        tell.then_some(if (mask_w > mask_h) == (w > h) { Made::ForStored } else { Made::ForTurned })
    }

    /// What the mask itself tells: its EXIF data may ask for the turn of the photo.
    fn by_itself(&self) -> Option<Made> {
        self.by_sides().or((self.mask.turn == self.photo.turn).then_some(Made::ForStored))
    }

    /// The turn that lays a mask on its photo.
    fn turn(&self, made: Made) -> Orientation {
        match (made, self.turn) {
            (Made::ForStored, turn) => turn,
            (Made::ForTurned, Orientation::NoTransforms) => inverse(self.photo.turn),
            (Made::ForTurned, _) => Orientation::NoTransforms,
        }
    }

    fn as_its_photo(&self) -> Made {
        if self.turn == Orientation::NoTransforms { Made::ForStored } else { Made::ForTurned }
    }
}

fn inverse(turn: Orientation) -> Orientation {
    match turn {
        Orientation::Rotate90 => Orientation::Rotate270,
        Orientation::Rotate270 => Orientation::Rotate90,
        // Half a turn and all mirrors undo themselves.
        other => other,
    }
}

/// The turns that lay the masks on their photos; warns where neither mask nor photo as taken tell which they are.
pub(crate) fn turns(views: &[Masked<'_>], report: &mut Report) -> Vec<Orientation> {
    let asked = || views.iter().filter(|view| view.is_asked_to_turn());
    let mut told = asked().filter_map(Masked::by_sides);
    let first = told.next();
    let by_others = first.filter(|first| told.all(|made| made == *first));
    let open: Vec<&Masked<'_>> = asked().filter(|view| view.by_itself().is_none()).collect();
    let names = |open: &[&Masked<'_>]| first_names(open.iter().map(|view| view.name));
    let mut warn = |open: &[&Masked<'_>], how: &str| {
        if !open.is_empty() {
            let what = format!(
                "the EXIF data of {} photos with a mask ask to turn or mirror them, and the sides of these masks do not show \
                 whether they are turned; {how}: {}",
                open.len(),
                names(open)
            );
            report.warn("masks-of-turned-photos", open.len(), what);
        }
    };
    match by_others {
        Some(Made::ForStored) => {
            warn(&open, "like the others of the capture they are taken for the pixels as stored")
        }
        Some(Made::ForTurned) => {
            warn(&open, "like the others of the capture they are taken for the photo as turned")
        }
        None => {
            let turned: Vec<_> =
                open.into_iter().filter(|view| view.turn != Orientation::NoTransforms).collect();
            warn(
                &turned,
                "they are taken as an image editor shows the photo, turned; turn those that a program wrote for the \
                 pixels as stored",
            );
        }
    }
    views
        .iter()
        .map(|view| view.turn(view.by_itself().or(by_others).unwrap_or_else(|| view.as_its_photo())))
        .collect()
}
