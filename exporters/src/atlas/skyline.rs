//! Packs rectangles onto pages with a skyline, from the highest to the lowest rectangle. The result depends only on the
//! sizes and their order.

/// The position of a rectangle; empty ones lie at the origin of page 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Placement {
    /// Index of the page that holds the rectangle.
    pub page: u16,
    /// Left column, texels.
    pub x: u16,
    /// Upper row, texels.
    pub y: u16,
}

/// Places rectangles of `[width, height]` texels on pages of at most `side` texels. Returns the placements and
/// the pages' `[width, height]`, or `None` if a rectangle is larger than a page or there are too many pages.
pub fn pack(sizes: &[[u16; 2]], side: u16) -> Option<(Vec<Placement>, Vec<[u16; 2]>)> {
    let mut order: Vec<usize> = (0..sizes.len()).filter(|&i| sizes[i][0] > 0 && sizes[i][1] > 0).collect();
    if order.iter().any(|&i| sizes[i].iter().any(|&s| s > side)) {
        return None;
    }
    order.sort_by_key(|&i| (std::cmp::Reverse(sizes[i][1]), std::cmp::Reverse(sizes[i][0]), i));
    let area: u64 = order.iter().map(|&i| u64::from(sizes[i][0]) * u64::from(sizes[i][1])).sum();
    let widest = order.iter().map(|&i| sizes[i][0]).max().unwrap_or(0);
    // About square; a multiple of four keeps rows of pixels aligned.
    let about = (area as f64).sqrt().ceil().min(f64::from(side)) as u16;
    let width = about.max(widest).next_multiple_of(4).min(side).max(widest);

    let mut placements = vec![Placement::default(); sizes.len()];
    let mut pages: Vec<[u16; 2]> = Vec::new();
    let mut skyline = Skyline::new(width);
    for i in order {
        let [w, h] = sizes[i];
        let found = skyline.place(w, h, side);
        let (x, y) = match found {
            Some(place) if !pages.is_empty() => place,
            _ => {
                pages.push([width, 0]);
                skyline = Skyline::new(width);
                skyline.place(w, h, side)?
            }
        };
        let last = pages.len() - 1;
        placements[i] = Placement { page: u16::try_from(last).ok()?, x, y };
        pages[last][1] = pages[last][1].max(y + h);
    }
    Some((placements, pages))
}

/// The edge of the occupied part of a page, from left to right.
struct Skyline {
    /// `[x, y]` of each segment, which ends where the next begins.
    segments: Vec<[u16; 2]>,
    width: u16,
}

impl Skyline {
    fn new(width: u16) -> Self {
        Self { segments: vec![[0, 0]], width }
    }

    /// Finds the lowest position, of several the leftmost, and occupies it.
    fn place(&mut self, w: u16, h: u16, height: u16) -> Option<(u16, u16)> {
        let mut best: Option<(u16, usize)> = None;
        for first in 0..self.segments.len() {
            let [x, y] = self.segments[first];
            if w > self.width - x {
                break;
            }
            let lowest = best.map_or(height - h + 1, |(y, _)| y);
            if y < lowest
                && let Some(y) = self.highest_under(first, x + w, lowest)
            {
                best = Some((y, first));
            }
        }
        let (y, first) = best?;
        let x = self.segments[first][0];
        self.raise(first, x + w, y + h);
        Some((x, y))
    }

    /// The highest edge between a segment and a column; `None` if it is not below a limit.
    fn highest_under(&self, first: usize, end: u16, limit: u16) -> Option<u16> {
        let mut highest = 0;
        for &[x, y] in &self.segments[first..] {
            if x >= end {
                break;
            }
            highest = highest.max(y);
            if highest >= limit {
                return None;
            }
        }
        Some(highest)
    }

    /// Moves the edge between a segment and a column to `y`.
    fn raise(&mut self, first: usize, end: u16, y: u16) {
        let after = self.segments[first..].iter().position(|s| s[0] >= end).map(|n| first + n);
        let after = after.unwrap_or(self.segments.len());
        let rest = self.segments[after - 1][1];
        let next_begins = self.segments.get(after).map_or(self.width, |s| s[0]);
        let x = self.segments[first][0];
        let tail = (end < next_begins).then_some([end, rest]);
        self.segments.splice(first..after, std::iter::once([x, y]).chain(tail));
        // Neighbours of equal height become one segment.
        let last = (first + 2).min(self.segments.len() - 1);
        for i in (first.max(1)..=last).rev() {
            if self.segments[i][1] == self.segments[i - 1][1] {
                self.segments.remove(i);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    /// Sides of 2 to 64 texels, log-normal, correlated, mean area about 90: those of trained scenes.
    fn maps(count: usize) -> Vec<[u16; 2]> {
        let mut state = 1_u64;
        let mut uniform = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let mut normal = move || (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos();
        let side = |z: f64| (7.4 * (0.6 * z).exp()).round().clamp(2.0, 64.0) as u16;
        (0..count)
            .map(|_| {
                let (a, b) = (normal(), normal());
                [side(a), side(0.4 * a + 0.84_f64.sqrt() * b)]
            })
            .collect()
    }

    /// Texels that are covered; panics where two rectangles overlap or leave their page.
    fn covered(sizes: &[[u16; 2]], placements: &[Placement], pages: &[[u16; 2]]) -> u64 {
        let mut taken: Vec<Vec<bool>> =
            pages.iter().map(|p| vec![false; usize::from(p[0]) * usize::from(p[1])]).collect();
        for (size, at) in sizes.iter().zip(placements) {
            for row in at.y..at.y + size[1] {
                for col in at.x..at.x + size[0] {
                    let [width, height] = pages[usize::from(at.page)];
                    assert!(col < width && row < height, "{at:?} {size:?} leaves its page");
                    let texel = usize::from(row) * usize::from(width) + usize::from(col);
                    assert!(
                        !std::mem::replace(&mut taken[usize::from(at.page)][texel], true),
                        "{at:?} overlaps"
                    );
                }
            }
        }
        taken.iter().flatten().filter(|t| **t).count() as u64
    }

    #[test]
    fn maps_fill_pages_without_overlap() {
        for (count, side, least) in
            [(100_000, 4096, 0.97), (10_000, 512, 0.97), (1_000, 4096, 0.95), (3, 64, 0.3)]
        {
            let sizes = maps(count);
            let (placements, pages) = pack(&sizes, side).unwrap();
            let area: u64 = sizes.iter().map(|s| u64::from(s[0]) * u64::from(s[1])).sum();
            assert_eq!(covered(&sizes, &placements, &pages), area);
            let paper: u64 = pages.iter().map(|p| u64::from(p[0]) * u64::from(p[1])).sum();
            let occupancy = area as f64 / paper as f64;
            println!("{count}: {} pages, {occupancy:.4}", pages.len());
            assert!(occupancy >= least, "{count}: {occupancy}");
            assert_eq!(pack(&sizes, side), Some((placements, pages)), "deterministic");
        }
    }

    #[test]
    fn packing_200_000_maps_is_fast() {
        let sizes = maps(200_000);
        let start = Instant::now();
        assert!(pack(&sizes, 4096).is_some());
        let took = start.elapsed();
        // Aim: 0.3 s; needed 0.06 s without debug assertions. Machines that are busy take longer.
        assert!(took.as_secs_f64() < 2.0, "{took:?}");
    }

    #[test]
    fn oversized_maps_are_refused_and_no_maps_need_no_page() {
        assert_eq!(pack(&[[2, 2], [65, 1]], 64), None);
        assert_eq!(pack(&[[0, 0], [0, 0]], 64), Some((vec![Placement::default(); 2], Vec::new())));
        let (placements, pages) = pack(&[[64, 64], [0, 0], [64, 64]], 64).unwrap();
        assert_eq!(pages, [[64, 64]; 2]);
        assert_eq!([placements[0].page, placements[2].page], [0, 1]);
    }

    #[test]
    #[should_panic(expected = "overlaps")]
    fn the_overlap_check_detects_a_shifted_rectangle() {
        let sizes = maps(100);
        let (mut placements, pages) = pack(&sizes, 512).unwrap();
        placements[50].x = placements[49].x;
        placements[50].y = placements[49].y;
        covered(&sizes, &placements, &pages);
    }
}
