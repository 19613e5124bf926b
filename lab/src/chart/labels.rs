//! Places the labels of points next to them, clear of other points, labels and lines.

use super::look::MARK_PX;
use super::svg::{TEXT_PX, text_width_px};

/// Free space on both sides of a label.
const LABEL_GAP_PX: f64 = 2.0;

/// A rectangle in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
}

impl Rect {
    fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn contains(&self, other: &Self) -> bool {
        self.left <= other.left
            && other.right <= self.right
            && self.top <= other.top
            && other.bottom <= self.bottom
    }
}

/// The square of half side `r` around a point.
pub fn around((x, y): (f64, f64), r: f64) -> Rect {
    Rect { left: x - r, right: x + r, top: y - r, bottom: y + r }
}

/// Small rectangles that cover a line.
pub fn along(line: &[(f64, f64)]) -> Vec<Rect> {
    const STEP_PX: f64 = 4.0;
    let piece = |w: &[(f64, f64)]| {
        let (from, to) = (w[0], w[1]);
        let n = ((to.0 - from.0).hypot(to.1 - from.1) / STEP_PX).ceil().max(1.0);
        let at = move |i: usize| {
            (from.0 + (to.0 - from.0) * i as f64 / n, from.1 + (to.1 - from.1) * i as f64 / n)
        };
        (0..=n as usize).map(move |i| around(at(i), 1.0))
    };
    line.windows(2).flat_map(piece).collect()
}

/// The side of their points on which labels are tried first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Left,
    Right,
}

/// Left ends of the labels' baselines, next to their points and over no other point or label; `None` for labels without
/// room. `obstacles` (lines and small markers) are avoided where possible.
pub fn place_labels(
    points: &[(f64, f64)],
    texts: &[Option<&str>],
    bounds: Rect,
    obstacles: &[Rect],
    first: Side,
) -> Vec<Option<(f64, f64)>> {
    let mut taken: Vec<Rect> = points.iter().map(|&p| around(p, MARK_PX + 1.0)).collect();
    let mut places = Vec::new();
    for ((x, y), text) in points.iter().zip(texts) {
        let place = text.and_then(|text| {
            let width = text_width_px(text, TEXT_PX);
            let gap = MARK_PX + 4.0;
            let (left, right) = (x - gap - width, x + gap);
            let (near_left, near_right) = (x - 0.6 * gap - width, x + 0.6 * gap);
            let (above, below) = (y - 0.8 * gap, y + gap + 7.0);
            let mut starts = [
                (right, y + 4.0),
                (near_right, below),
                (left, y + 4.0),
                (near_left, above),
                (x - 0.5 * width, y - gap - 1.0),
                (x - 0.5 * width, y + gap + 9.0),
                (near_right, above),
                (near_left, below),
            ];
            if first == Side::Left {
                starts.rotate_left(2);
            }
            let extent = |&(left, baseline): &(f64, f64)| Rect {
                left: left - LABEL_GAP_PX,
                right: left + width + LABEL_GAP_PX,
                top: baseline - 10.0,
                bottom: baseline + 3.0,
            };
            let free = |b: &Rect| bounds.contains(b) && !taken.iter().any(|t| t.overlaps(b));
            let is_clear = |b: &Rect| !obstacles.iter().any(|d| d.overlaps(b));
            let possible: Vec<_> = starts.iter().map(|s| (*s, extent(s))).filter(|(_, e)| free(e)).collect();
            possible.iter().find(|(_, e)| is_clear(e)).or(possible.first()).copied()
        });
        if let Some((_, extent)) = place {
            taken.push(extent);
        }
        places.push(place.map(|(start, _)| start));
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_overlap_neither_points_nor_each_other() {
        // Points on a diagonal, too close for all labels to have room.
        let points: Vec<(f64, f64)> =
            (0..40).map(|i| (60.0 + 9.0 * f64::from(i), 90.0 + 4.0 * f64::from(i))).collect();
        let texts: Vec<Option<&str>> =
            (0..40).map(|i| (i % 3 != 0).then_some("variant, 300 steps")).collect();
        let bounds = Rect { left: 50.0, right: 500.0, top: 60.0, bottom: 340.0 };
        let places = place_labels(&points, &texts, bounds, &[], Side::Right);
        let width = text_width_px("variant, 300 steps", TEXT_PX);
        let boxes: Vec<Rect> = places
            .iter()
            .flatten()
            .map(|&(left, y)| Rect { left, right: left + width, top: y - 10.0, bottom: y + 3.0 })
            .collect();
        assert!((3..26).contains(&boxes.len()), "{}", boxes.len());
        for (i, b) in boxes.iter().enumerate() {
            assert!(bounds.contains(b) && boxes[..i].iter().all(|other| !other.overlaps(b)));
            assert!(points.iter().all(|&(x, y)| !(b.left < x && x < b.right && b.top < y && y < b.bottom)));
        }
        assert_eq!(place_labels(&points[..1], &[None], bounds, &[], Side::Left), [None]);
        // Negative control: a single point has room.
        let alone =
            |over: &[Rect]| place_labels(&points[..1], &[Some("a")], bounds, over, Side::Right)[0].unwrap();
        // A line to the right is avoided; lines everywhere are not.
        assert_ne!(alone(&along(&[points[0], (400.0, points[0].1)])), alone(&[]));
        assert_eq!(alone(&[Rect { left: 0.0, right: 999.0, top: 0.0, bottom: 999.0 }]), alone(&[]));
    }
}
