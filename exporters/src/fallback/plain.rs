//! Rules for splats in formats without textures, whatever program wrote them: one issue per rule with the number of
//! offending splats and the first of them, so that a scene of millions makes a few lines.
//!
//! | code | severity | rule |
//! |---|---|---|
//! | LT4001 | error | the file can be read |
//! | LT4002 | error | numbers are finite (opacities and scales may be infinite before they are activated) |
//! | LT4003 | error | quaternions are not of length 0 |
//! | LT4004 | info | quaternions are of length 1: programs that do not normalise them show other shapes |
//! | LT4005 | warning | standard deviations are in the range that other programs compute with |
//! | LT4006 | info | splats can be seen: opacity above 1/255 |
//! | LT4007 | warning | no splat lies far from the others: viewers fit their cameras to all of them |
//! | LT4008 | info | splats are discs, as textured splats are: others lose their thinnest axis |
//! | LT4009 | warning | f32 resolves the sizes of splats where they lie |
//! | LT4010 | warning | metadata of this program can be read |
//! | LT4011 | info | the file is laid out as all programs expect it |
//! | LT4012 | warning | no extension record says that splats are meant otherwise than all programs expect |

use crate::{Issue, Severity};

/// Deviation from length 1 that the f32 arithmetic of other programs explains.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Opacity below which splats are not drawn.
const OPACITY_MIN: f64 = 1.0 / 255.0;

/// Standard deviations whose covariances f32 holds: squares from 1e-36 to 1e12.
const SCALES: [f64; 2] = [1e-18, 1e6];

/// A splat lies far out beyond this many times the distance within which nine of ten lie.
const FAR: f64 = 100.0;

/// Steps of f32 that a standard deviation must span at the splat's position.
const STEPS_MIN: f64 = 4.0;

/// A splat of the file, activated.
pub(crate) struct Raw {
    pub(crate) position: [f64; 3],
    /// Length of the quaternion.
    pub(crate) norm: f64,
    /// Standard deviations along the two largest axes.
    pub(crate) scales: [f64; 2],
    /// In [0, 1].
    pub(crate) opacity: f64,
    /// Whether SH and everything else is finite.
    pub(crate) is_finite: bool,
    /// Whether it differs visibly from a disc.
    pub(crate) is_thick: bool,
}

/// The issue of a file that cannot be read.
pub(crate) fn unreadable(error: &crate::Error) -> Issue {
    Issue::new("LT4001", Severity::Error, "", &error.text())
}

/// Splats that offend against one rule.
#[derive(Clone, Copy, Default)]
struct Count {
    first: usize,
    number: usize,
}

impl Count {
    fn add(&mut self, splat: usize, offends: bool) {
        if offends && self.number == 0 {
            self.first = splat;
        }
        self.number += usize::from(offends);
    }

    fn issue(self, code: &'static str, severity: Severity, what: &str) -> Option<Issue> {
        let Self { first, number } = self;
        let place = format!("splat {first}");
        (number > 0).then(|| {
            Issue::new(code, severity, &place, &format!("{number} splats {what}; the first is {first}"))
        })
    }
}

/// Collects splats, then lists the issues.
#[derive(Default)]
pub(crate) struct Check {
    num_splats: usize,
    broken: Count,
    shapeless: Count,
    not_unit: Count,
    odd_scales: Count,
    invisible: Count,
    thick: Count,
    coarse: Count,
    positions: Vec<[f32; 3]>,
}

impl Check {
    /// Adds the next splat.
    pub(crate) fn add(&mut self, splat: &Raw) {
        let i = self.num_splats;
        self.num_splats += 1;
        let is_finite = splat.is_finite && splat.position.iter().all(|v| v.is_finite());
        self.broken.add(i, !is_finite);
        self.shapeless.add(i, splat.norm == 0.0);
        self.not_unit.add(i, splat.norm > 0.0 && (splat.norm - 1.0).abs() > UNIT_TOLERANCE);
        let is_sane = splat.scales.iter().all(|s| (SCALES[0]..=SCALES[1]).contains(s));
        self.odd_scales.add(i, is_finite && !is_sane);
        self.invisible.add(i, splat.opacity < OPACITY_MIN);
        self.thick.add(i, splat.is_thick);
        let farthest = splat.position.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        let step = farthest * f64::from(f32::EPSILON);
        self.coarse.add(i, is_finite && is_sane && splat.scales[0].max(splat.scales[1]) < STEPS_MIN * step);
        if is_finite {
            self.positions.push(splat.position.map(|v| v as f32));
        }
    }

    /// The issues of all splats added.
    pub(crate) fn issues(self) -> Vec<Issue> {
        use Severity::{Error, Info, Warning};
        let far = self.far_out();
        let found = [
            self.broken.issue("LT4002", Error, "have numbers that are not finite"),
            self.shapeless.issue("LT4003", Error, "have a quaternion of length 0"),
            self.not_unit.issue("LT4004", Info, "have quaternions that are not of length 1"),
            self.odd_scales.issue("LT4005", Warning, "have standard deviations that are not in 1e-18 to 1e6"),
            self.invisible.issue("LT4006", Info, "are never drawn: their opacity is below 1/255"),
            far.issue("LT4007", Warning, "are a hundred times farther out than the nearest 90 % of splats"),
            self.thick.issue("LT4008", Info, "are thick: as textured splats they lose their thinnest axis"),
            self.coarse.issue(
                "LT4009",
                Warning,
                "are smaller than the f32 spacing at their position: centre the scene on its origin",
            ),
        ];
        found.into_iter().flatten().collect()
    }

    /// Splats far from the median position.
    fn far_out(&self) -> Count {
        let mut count = Count::default();
        let n = self.positions.len();
        if n < 10 {
            return count;
        }
        let middle: [f32; 3] = std::array::from_fn(|axis| {
            let mut of_axis: Vec<f32> = self.positions.iter().map(|p| p[axis]).collect();
            *of_axis.select_nth_unstable_by(n / 2, f32::total_cmp).1
        });
        let distance = |p: &[f32; 3]| {
            (0..3).map(|i| (f64::from(p[i]) - f64::from(middle[i])).powi(2)).sum::<f64>().sqrt()
        };
        let mut distances: Vec<f64> = self.positions.iter().map(distance).collect();
        let near = *distances.select_nth_unstable_by(n * 9 / 10, f64::total_cmp).1;
        for (i, position) in self.positions.iter().enumerate() {
            count.add(i, near > 0.0 && distance(position) > FAR * near);
        }
        count
    }
}
