//! Twin of the kernels that list the splats of each tile, for tests: random bounds, and their tile lists computed in
//! the obvious way.

use super::shader::{DEPTH_KEY_BITS, GROUP, TILE_PX};
use super::sort::group_list_entries;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg32;

/// `Bounds` of `shaders/common/bounds.wgsl`.
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct TestBounds {
    centre_px: [f32; 2],
    per_half_height: f32,
    shear: f32,
    half_span_px: f32,
    rightmost_dy_px: f32,
    box_min: u32,
    box_max: u32,
    pub num_tiles: u32,
    pub first_slot: u32,
    results: [u32; 3],
    pub depth_key: u32,
    rest: [u32; 2],
}

/// The splats of a view.
#[derive(Clone)]
pub(super) struct TileListCase {
    pub size_px: [u32; 2],
    pub bounds: Vec<TestBounds>,
    /// Each splat's tiles, in the order of their numbers.
    tiles: Vec<Vec<u32>>,
}

/// Columns and rows of tiles.
pub(super) fn grid_of(size_px: [u32; 2]) -> [u32; 2] {
    size_px.map(|size| size.div_ceil(TILE_PX))
}

impl TileListCase {
    /// Boxes, ellipses, single pixels and invisible splats, with many ties among the depth keys.
    pub(super) fn random(seed: u64, size_px: [u32; 2], n: usize) -> Self {
        let mut rng = Pcg32::seed_from_u64(seed);
        let mut case = Self { size_px, bounds: Vec::new(), tiles: Vec::new() };
        while case.bounds.len() < n {
            let mut bounds = match rng.random_range(0..8) {
                0 => TestBounds::default(),
                1 => random_box(size_px, &mut rng),
                _ => random_ellipse(size_px, &mut rng),
            };
            // Leaves out bounds whose tiles change within 0.02 px: rounding moves the end of a span by up to 0.007 px
            // (at the root near the tip of a span of 30 px).
            let tiles = tiles_of(&bounds, size_px, 0.03);
            if tiles != tiles_of(&bounds, size_px, -0.01) {
                continue;
            }
            bounds.num_tiles = tiles.len() as u32;
            bounds.depth_key = if tiles.is_empty() {
                (1 << DEPTH_KEY_BITS) - 1
            } else {
                rng.random_range(0..n as u32 / 4 + 1) * 99_991
            };
            case.bounds.push(bounds);
            case.tiles.push(tiles);
        }
        case
    }

    pub(super) fn num_tiles(&self) -> u32 {
        grid_of(self.size_px).iter().product()
    }

    pub(super) fn same_depth(&self, a: u32, b: u32) -> bool {
        self.key(a) == self.key(b)
    }

    fn key(&self, splat: u32) -> u32 {
        self.bounds[splat as usize].depth_key
    }

    /// Splats of each tile by depth key, then index.
    pub(super) fn lists(&self) -> Vec<Vec<u32>> {
        let mut lists = vec![Vec::new(); self.num_tiles() as usize];
        for (splat, tiles) in (0..).zip(&self.tiles) {
            tiles.iter().for_each(|&tile| lists[tile as usize].push(splat));
        }
        for list in &mut lists {
            list.sort_unstable_by_key(|&splat: &u32| (self.key(splat), splat));
        }
        lists
    }
}

/// The visible splats of each group of [`GROUP`] splats and the number of their pairs, as `project` lists them.
pub(super) fn group_lists(bounds: &[TestBounds]) -> Vec<u32> {
    let (groups, group) = (bounds.len().div_ceil(GROUP as usize), GROUP as usize);
    let mut out = vec![0xabcd_ef01; group_list_entries(bounds.len() as u64) as usize];
    for (k, bounds) in bounds.chunks(group).enumerate() {
        let seen: Vec<usize> = (0..bounds.len()).filter(|&i| bounds[i].num_tiles > 0).collect();
        seen.iter().enumerate().for_each(|(at, &i)| out[k * group + at] = (k * group + i) as u32);
        out[groups * group + k] = seen.len() as u32;
        let pairs = bounds.iter().fold(0_u32, |sum, b| sum.saturating_add(b.num_tiles));
        out[groups * (group + 1) + k] = pairs;
    }
    out
}

fn random_box(size_px: [u32; 2], rng: &mut Pcg32) -> TestBounds {
    let [x, y] = size_px.map(|size| {
        let first = rng.random_range(0..size);
        [first, rng.random_range(first + 1..=(first + 90).min(size))]
    });
    let [box_min, box_max] = [0, 1].map(|k| x[k] | y[k] << 16);
    TestBounds { half_span_px: 1e9, box_min, box_max, ..TestBounds::default() }
}

fn random_ellipse(size_px: [u32; 2], rng: &mut Pcg32) -> TestBounds {
    let centre = size_px.map(|size| rng.random_range(-20.0..f64::from(size) + 20.0));
    let axes: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0_f64..3.6).exp());
    let (sin, cos) = rng.random_range(0.0_f64..3.2).sin_cos();
    let [u, v] = axes.map(|axis| axis * axis);
    let (xx, yy, xy) = (u * cos * cos + v * sin * sin, u * sin * sin + v * cos * cos, (u - v) * sin * cos);
    let half = [xx.sqrt(), yy.sqrt()];
    let corner = |side: f64, k: usize| (centre[k] + side * half[k]).clamp(0.0, f64::from(size_px[k]));
    let first = [0, 1].map(|k| (corner(-1.0, k) - 0.5).ceil().max(0.0) as u32);
    let past = [0, 1].map(|k| (corner(1.0, k) - 0.5).floor() as i64 + 1);
    if (0..2).any(|k| i64::from(first[k]) >= past[k]) {
        return TestBounds::default();
    }
    TestBounds {
        centre_px: centre.map(|c| c as f32),
        per_half_height: (1.0 / half[1]) as f32,
        shear: (xy / yy) as f32,
        half_span_px: (xx - xy * xy / yy).sqrt() as f32,
        // Height of the rightmost point of x = r cos, y = r sin in the covariance's frame.
        rightmost_dy_px: (xy / half[0]) as f32,
        box_min: first[0] | first[1] << 16,
        box_max: past[0] as u32 | (past[1] as u32) << 16,
        ..TestBounds::default()
    }
}

/// Tiles that a splat touches: in each row of tiles, the run between its leftmost and rightmost point; if it is at
/// most a tile high, only points at the height of pixel centres count.
fn tiles_of(bounds: &TestBounds, size_px: [u32; 2], margin_px: f64) -> Vec<u32> {
    let unpack = |packed: u32| [packed & 0xffff, packed >> 16];
    let (low, high) = (unpack(bounds.box_min), unpack(bounds.box_max));
    let [centre_x, centre_y] = bounds.centre_px.map(f64::from);
    let half = |dy: f64| {
        let t = dy * f64::from(bounds.per_half_height);
        f64::from(bounds.half_span_px) * (1.0 - t * t).max(0.0).sqrt()
    };
    let middle = |dy: f64| centre_x + f64::from(bounds.shear) * dy;
    let tip = f64::from(bounds.rightmost_dy_px);
    let columns = |left_dy: f64, right_dy: f64| {
        let left = middle(left_dy) - half(left_dy) - margin_px;
        let right = middle(right_dy) + half(right_dy) + margin_px;
        // Columns of pixels whose centres lie between the two.
        (low[0]..high[0]).filter(move |&x| (left..=right).contains(&(f64::from(x) + 0.5)))
    };
    let mut out = Vec::new();
    for row in 0..grid_of(size_px)[1] {
        let rows = low[1].max(row * TILE_PX)..high[1].min((row + 1) * TILE_PX);
        let dy = |y: u32| f64::from(y) + 0.5 - centre_y;
        let touched: Vec<u32> = if high[1] - low[1] <= TILE_PX {
            rows.flat_map(|y| columns(dy(y), dy(y))).collect()
        } else if rows.is_empty() {
            continue;
        } else {
            let (first, last) = (dy(rows.start), dy(rows.end - 1));
            columns((-tip).clamp(first, last), tip.clamp(first, last)).collect()
        };
        if let (Some(first), Some(last)) = (touched.iter().min(), touched.iter().max()) {
            out.extend((first / TILE_PX..=last / TILE_PX).map(|column| row * grid_of(size_px)[0] + column));
        }
    }
    out
}
