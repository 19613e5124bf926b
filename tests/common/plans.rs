//! Compares how backends apply density-control plans: bit for bit where that is specified.

use litetex_gs::backend::{Backend, DensityPlan, MapChange};
use litetex_gs::model::{AdamState, Model};

pub type State = (Model, AdamState);

/// Selects an array of a state.
type Values = fn(&State) -> &Vec<f32>;

/// A plan that only moves the model to new buffers.
pub fn keep(num_splats: usize) -> DensityPlan {
    DensityPlan {
        sources: (0..num_splats as u32).collect(),
        maps: vec![MapChange::Keep; num_splats],
        ..DensityPlan::default()
    }
}

pub fn applied(backend: &mut dyn Backend, start: &State, plan: &DensityPlan) -> State {
    backend.upload(&start.0, &start.1).unwrap();
    backend.apply_plan(plan).unwrap();
    backend.read_back().unwrap()
}

/// Number of values that differ in resampled maps, their largest difference over the largest value of all, and
/// number of values that differ in other maps. Differences below the smallest normal number are ignored,
/// because some devices flush denormals to zero.
fn texels_off(plan: &DensityPlan, a: &State, b: &State, array: Values) -> [f32; 3] {
    let (mut resampled, mut other, mut worst) = (0, 0, 0.0_f32);
    let (a_values, b_values) = (array(a), array(b));
    assert_eq!(a_values.len(), b_values.len());
    let largest = b_values.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
    for (change, map) in plan.maps.iter().zip(&b.0.textures.maps) {
        for f in map.floats() {
            let off = (a_values[f] - b_values[f]).abs();
            let differs = off >= f32::MIN_POSITIVE || !off.is_finite();
            if matches!(change, MapChange::Resample { .. }) {
                resampled += usize::from(differs);
                worst = worst.max(off / largest);
            } else {
                other += usize::from(differs);
            }
        }
    }
    [resampled as f32, worst, other as f32]
}

const ARRAYS: [(&str, Values); 3] = [
    ("texels", |s| &s.0.textures.texels),
    ("first moments", |s| &s.1.texels_m),
    ("second moments", |s| &s.1.texels_v),
];

/// Whether two backends applied a plan to the same result.
pub fn agree(plan: &DensityPlan, a: &State, b: &State) -> bool {
    let mut ok = a.0.textures.maps == b.0.textures.maps && a.1.last_step == b.1.last_step;
    ok &= (&a.0.splats, &a.1.splats_m, &a.1.splats_v) == (&b.0.splats, &b.1.splats_m, &b.1.splats_v);
    if a.0.textures.maps != b.0.textures.maps {
        return false;
    }
    for (name, array) in ARRAYS {
        let [resampled, worst, other] = texels_off(plan, a, b, array);
        println!("{name}: {resampled} resampled values differ, at most by {worst:.1e}; {other} others");
        // Drivers may contract products and sums of the interpolation; needed 0 on lavapipe and SwiftShader.
        ok &= worst < 2e-6 && other == 0.0;
    }
    ok
}
