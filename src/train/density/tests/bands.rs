//! SH bands: lost and gained.

use super::*;
use crate::constants::sh_coefficients;

#[test]
fn bands_that_hardly_change_the_colour_are_dropped() {
    let (mut model, cameras, statistics) = (model(2), [camera()], window([0.1; N]));
    model.splats.set_sh_degrees(&[3; N]);
    model.splats.sh.fill(0.0);
    let mut sh = |splat: usize, degree: u32, value: f32| {
        model.splats.sh_of_mut(splat)[3 * sh_coefficients(degree - 1)..][..3].fill(value);
    };
    // A strong band 1; a strong band 3 above nothing; a strong band 2 and a faint band 3.
    sh(1, 1, 0.5);
    sh(2, 3, 0.5);
    sh(3, 2, 0.5);
    sh(3, 3, 1e-3);
    let histories = vec![SplatHistory::first(2); N];
    let degrees = |sh_tested: u32, below: f64| {
        let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_below: below, ..settings() };
        let s = situation(&model, &histories, &statistics, &cameras, &config);
        let revision = litetex::revise(&Situation { timing: Timing { sh_tested, ..TIMING }, ..s });
        let degrees =
            revision.plan.map_or_else(|| model.splats.sh_degrees().to_vec(), |plan| plan.sh_degrees);
        assert_eq!(revision.counts.bands_lost, degrees.iter().filter(|&&d| d < 3).count());
        degrees[..5].to_vec()
    };
    assert_eq!(degrees(3, 0.01), [0, 1, 3, 2, 0]);
    // Bands 2 and 3 are too young: they follow band 1, unless they already matter.
    assert_eq!(degrees(1, 0.01), [0, 3, 3, 3, 0]);
    assert_eq!(degrees(0, 0.01), [3; 5]);
    assert_eq!(degrees(3, 0.0), [3; 5]);
    assert_eq!(degrees(3, 10.0), [0; 5]);
    // A splat that no view saw keeps its bands; one that contributes much keeps fainter ones than others.
    let mut unseen = statistics.clone();
    unseen.seen[0] = 0;
    (unseen.contribution[1], unseen.contribution[2]) = (10.0, 1e-5);
    let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_below: 0.01, ..settings() };
    let s = situation(&model, &histories, &unseen, &cameras, &config);
    let s = Situation { timing: Timing { sh_tested: 3, ..TIMING }, ..s };
    assert_eq!(litetex::revise(&s).plan.unwrap().sh_degrees[..3], [3, 1, 0]);
}

#[test]
fn splats_whose_highest_band_matters_gain_another() {
    let (mut model, cameras, statistics) = (model(2), [camera()], window([0.1; N]));
    let mut held = [1; N];
    (held[3], held[4]) = (3, 0);
    model.splats.set_sh_degrees(&held);
    model.splats.sh.fill(0.0);
    // Strong, very strong, fair, strong at the highest degree, and nothing but DC.
    for (splat, value) in [0.5, 0.8, 0.1, 0.5, 0.5].into_iter().enumerate() {
        model.splats.sh_of_mut(splat)[3 * usize::from(held[splat] > 0)..].fill(value);
    }
    let mut histories = vec![SplatHistory::first(2); N];
    let degrees = |histories: &[SplatHistory], change: &dyn Fn(&mut Timing), raise: f64| {
        let config = DensityConfig { coarsen_below: 0.0, quantile: 1.0, sh_raise: raise, ..settings() };
        let mut s = situation(&model, histories, &statistics, &cameras, &config);
        change(&mut s.timing);
        let revision = litetex::revise(&s);
        let degrees =
            revision.plan.map_or_else(|| model.splats.sh_degrees().to_vec(), |plan| plan.sh_degrees);
        let gained = degrees.iter().zip(held).filter(|(now, held)| *now > held).count();
        assert_eq!(revision.counts.bands_gained, gained);
        (degrees[..5].to_vec(), revision.histories)
    };
    let tested = |t: &mut Timing| (t.sh_tested, t.sh_trial_checks) = (3, 4);
    let (raised, later) = degrees(&histories, &tested, 0.2);
    assert_eq!(raised, [2, 2, 1, 3, 0]);
    assert_eq!(later[..3].iter().map(|h| h.band_checks).collect::<Vec<_>>(), [0, 0, u16::MAX]);
    assert_eq!(degrees(&histories, &tested, 0.0).0, held[..5]);
    // Not while bands are young, where bands were dropped, after growth, or beyond the degree of the run.
    assert_eq!(degrees(&histories, &|t| t.sh_tested = 0, 0.2).0, held[..5]);
    (histories[0].band_checks, histories[1].bands_settled) = (1, true);
    assert_eq!(degrees(&histories, &tested, 0.2).0, held[..5]);
    histories[0].band_checks = 3;
    assert_eq!(degrees(&histories, &tested, 0.2).0, [2, 1, 1, 3, 0]);
    assert_eq!(degrees(&histories, &|t| (t.sh_tested, t.grows) = (3, false), 0.2).0, held[..5]);
    assert_eq!(degrees(&histories, &|t| (t.sh_tested, t.sh_highest) = (3, 1), 0.2).0, held[..5]);
}
