//! Two splats of one plane as one, and what that changes.

use super::part::Part;
use crate::constants::SH_0;
use crate::model::TextureMap;
use crate::train::density::{TEXELS_MAX, even_texels, half_extents};
use crate::train::prune::costs::SplatCosts;
use crate::train::prune::round::Limits;
use glam::{DMat2, DMat3, DVec2, DVec3};

/// Samples along each axis on which a merged splat is compared with its parts, over [`REACH`] standard deviations.
const SAMPLES: usize = 12;
const REACH: f64 = 2.5;

/// Highest opacity of a merged splat: above it, alpha would be clamped.
const OPACITY_MAX: f64 = 0.985;

/// Largest residual of a merged splat, so that its texels can still be trained.
const RESIDUAL_MAX: f64 = 0.95;

/// Least cosine between the surface normals at two parts, and largest step between them, pixels of the nearest view.
const COSINE_MIN: f64 = 0.9;
const HEIGHT_PX: f64 = 2.0;

/// The two as one; `None` if they do not lie in one plane to within a pixel, if the result would be too long, or save no
/// parameters. It is compared with the splats that it is made of, among `all`.
pub fn merged(all: &[Part], [a, b]: [&Part; 2], normals: [DVec3; 2], limits: &Limits) -> Option<Part> {
    let mut whole = outline([a, b], normals, limits)?;
    let members: Vec<&Part> = whole.members.iter().map(|&member| &all[member as usize]).collect();
    let places = samples(&whole);
    let shown: Vec<Shown> = places.iter().map(|&at| together(&members, whole.point(at))).collect();
    let falloffs: Vec<f64> = places.iter().map(|&at| whole.falloff(at)).collect();
    // The opacity that comes nearest to their alphas.
    let products: f64 = falloffs.iter().zip(&shown).map(|(falloff, shown)| falloff * shown.alpha).sum();
    whole.opacity = (products / falloffs.iter().map(|f| f * f).sum::<f64>()).min(OPACITY_MAX);
    let alphas: f64 = shown.iter().map(|s| s.alpha).sum();
    let mean = [0, 1, 2].map(|c| shown.iter().map(|s| s.premultiplied[c]).sum::<f64>() / alphas);
    (0..3).for_each(|c| whole.sh[c] = (mean[c] - 0.5) / SH_0);
    draw_map(&members, limits, mean, &mut whole);
    let costs = whole.costs?;
    if whole.params() >= a.params() + b.params() {
        return None;
    }
    whole.cost = cost(&members, &whole, costs, (&places, &shown), mean);
    Some(whole)
}

/// What splats show at a point.
struct Shown {
    alpha: f64,
    premultiplied: [f64; 3],
    /// Sum of the squares of their alphas.
    squares: f64,
}

/// What splats of one plane show at a point, whatever their order: each as much as its alpha.
fn together(members: &[&Part], point: DVec3) -> Shown {
    let (mut transmittance, mut sum, mut squares, mut premultiplied) = (1.0, 0.0, 0.0, [0.0; 3]);
    for member in members {
        let at = member.in_plane(point);
        let alpha = member.opacity * member.falloff(at);
        let colour = member.colour(at);
        transmittance *= 1.0 - alpha;
        sum += alpha;
        squares += alpha * alpha;
        (0..3).for_each(|c| premultiplied[c] += alpha * colour[c]);
    }
    let alpha = 1.0 - transmittance;
    let share = if sum > 0.0 { alpha / sum } else { 0.0 };
    Shown { alpha, premultiplied: premultiplied.map(|p| share * p), squares }
}

/// Plane and falloff of the two as one, by the moments of their masses; without a map.
fn outline([a, b]: [&Part; 2], normals: [DVec3; 2], limits: &Limits) -> Option<Part> {
    let [share_a, share_b] = [a.mass(), b.mass()].map(|mass| mass / (a.mass() + b.mass()));
    let position = share_a * a.position + share_b * b.position;
    let facing = normals[0].dot(normals[1]);
    let normal = (share_a * normals[0] + share_b * facing.signum() * normals[1]).normalize();
    let pixel = a.pixel.min(b.pixel);
    let height = (a.position - b.position).dot(normal).abs();
    if facing.abs() < COSINE_MIN || height > HEIGHT_PX * pixel {
        return None;
    }
    let along = (a.axes.x_axis - a.axes.x_axis.dot(normal) * normal).normalize();
    let across = normal.cross(along);
    let project = |v: DVec3| DVec2::new(v.dot(along), v.dot(across));
    let covariance = [(a, share_a), (b, share_b)].into_iter().fold(DMat2::ZERO, |sum, (part, share)| {
        let outer = |v: DVec2| DMat2::from_cols(v * v.x, v * v.y);
        let [u, v] = [0, 1].map(|axis| project(part.sigmas[axis] * part.axes.col(axis)));
        sum + share * (outer(u) + outer(v) + outer(project(part.position - position)))
    });
    let (turn, variances) = principal(covariance);
    let u = turn.x * along + turn.y * across;
    let sigmas = variances.map(f64::sqrt);
    if sigmas[0].max(sigmas[1]) > limits.widest_px * pixel {
        return None;
    }
    let sh_degree = a.sh_degree.max(b.sh_degree);
    let longer = a.sh.len().max(b.sh.len());
    let coefficient = |part: &Part, k: usize| part.sh.get(k).copied().unwrap_or(0.0);
    Some(Part {
        members: a.members.iter().chain(&b.members).copied().collect(),
        position,
        axes: DMat3::from_cols(u, normal.cross(u), normal),
        sigmas,
        opacity: 1.0,
        sh: (0..longer).map(|k| share_a * coefficient(a, k) + share_b * coefficient(b, k)).collect(),
        sh_degree,
        map: TextureMap::default(),
        residuals: Vec::new(),
        costs: Some(SplatCosts {
            removal: a.costs?.removal + b.costs?.removal,
            colour: a.costs?.colour + b.costs?.colour,
        }),
        pixel,
        cost: 0.0,
    })
}

/// The first principal axis of a covariance, and the variances along both.
fn principal(covariance: DMat2) -> (DVec2, [f64; 2]) {
    let (xx, xy, yy) = (covariance.x_axis.x, covariance.x_axis.y, covariance.y_axis.y);
    let (middle, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
    let radius = half.hypot(xy);
    let angle = 0.5 * xy.atan2(half);
    (DVec2::from_angle(angle), [middle + radius, (middle - radius).max(1e-6 * middle)])
}

/// Places in the plane on which a splat is compared.
fn samples(whole: &Part) -> Vec<DVec2> {
    let along = |i: usize| REACH * (2.0 * (i as f64 + 0.5) / SAMPLES as f64 - 1.0);
    (0..SAMPLES * SAMPLES)
        .map(|k| DVec2::new(along(k / SAMPLES) * whole.sigmas[0], along(k % SAMPLES) * whole.sigmas[1]))
        .collect()
}

/// Gives the whole a map with as many texels per area as those of its members, if there are any, and no more than theirs.
fn draw_map(members: &[&Part], limits: &Limits, mean: [f64; 3], whole: &mut Part) {
    let area = |part: &&Part| {
        part.map.num_texels() as f64 * part.map.texel_sizes.map(f64::from).iter().product::<f64>()
    };
    let covered: f64 = members.iter().map(area).sum();
    let texels: usize = members.iter().map(|part| part.map.num_texels()).sum();
    let extents = half_extents(whole.sigmas, whole.opacity, limits.alpha_texture);
    // Maps of fewer texels than 2 x 2 cost more than they show.
    if texels < 4 || extents.contains(&0.0) {
        return;
    }
    let size = |edge: f64| extents.map(|half| even_texels(half, edge).min(TEXELS_MAX.into()));
    let mut edge = (covered / texels as f64).sqrt().max(limits.finest_px * whole.pixel);
    while size(edge).iter().product::<u32>() as usize > texels {
        edge *= 1.1;
    }
    let [rows, cols] = size(edge).map(|texels| texels as u16);
    whole.map = TextureMap::square(rows, cols, edge as f32);
    let origin = whole.map.origin().map(f64::from);
    whole.residuals = (0..rows)
        .flat_map(|row| (0..cols).map(move |col| (row, col)))
        .flat_map(|(row, col)| {
            let at = edge * DVec2::new(f64::from(row) - origin[0], f64::from(col) - origin[1]);
            let Shown { alpha, premultiplied, .. } = together(members, whole.point(at));
            [0, 1, 2].map(|c| {
                // Where none of them reaches, nothing is known of the colour.
                let residual = if alpha > 1e-6 { premultiplied[c] / alpha - mean[c] } else { 0.0 };
                residual.clamp(-RESIDUAL_MAX, RESIDUAL_MAX)
            })
        })
        .collect();
}

/// Mean squared change of the images if the whole takes the place of its members.
fn cost(
    members: &[&Part],
    whole: &Part,
    costs: SplatCosts,
    (places, shown): (&[DVec2], &[Shown]),
    mean: [f64; 3],
) -> f64 {
    let (mut by_alpha, mut by_colour, mut squares) = (0.0, 0.0, 0.0);
    for (&at, shown) in places.iter().zip(shown) {
        let alpha = whole.opacity * whole.falloff(at);
        let colour = whole.colour(at);
        let added = alpha - shown.alpha;
        by_alpha += added * added;
        let change = |c: usize| alpha * colour[c] - shown.premultiplied[c] - added * mean[c];
        by_colour += (0..3).map(|c| change(c).powi(2)).sum::<f64>();
        squares += shown.squares;
    }
    let bands = |part: &&Part| {
        let coefficient = |sh: &[f64], k: usize| sh.get(k).copied().unwrap_or(0.0);
        let change = |k: usize| coefficient(&whole.sh, k) - coefficient(&part.sh, k);
        let squares: f64 = (3..whole.sh.len()).map(|k| change(k).powi(2)).sum();
        part.costs.map_or(0.0, |costs| costs.colour) * squares / (3.0 * 4.0 * std::f64::consts::PI)
    };
    (costs.removal * by_alpha + costs.colour * by_colour / 3.0) / squares
        + members.iter().map(bands).sum::<f64>()
}
