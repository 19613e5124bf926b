//! The tensors of a model that is trained as its file will hold it.
//!
//! | tensor | type and shape |
//! |---|---|
//! | `rounded.step` | u32 `[2]`: step after which the model was last rounded; 1 if that was the last of the run |
//! | `rounded.factor_log2` | f64 `[1]`: factor on the quantisation steps, as a power of two |
//! | `rounded.steps` | f64 `[12]`: quantisation steps: position, tilt, twist, log2 of scales and of opacities, SH by degree, texels, |
//! | | ratio of chroma, log2 of texel sizes |
//! | `rounded.exponents`, `rounded.contributions` | i16, f32 `[n]` |
//! | `rounded.offsets.*` | as `splats.*`, and `texels` `[t,3]`, `texel_sizes` `[n,2]`: what rounding added |

use super::reader::{Reader, f32s, f64s, i16s, u32s};
use super::tensor::{Data, Tensor, arrays, put_arrays};
use crate::Result;
use crate::rounding::{LastRounding, Offsets, Quantisation};
use litetex_exporters::ltgs::Steps;
use safetensors::Dtype;

/// Adds the tensors.
pub fn put<'a>(rounded: &'a LastRounding, put: &mut dyn FnMut(&str, Tensor<'a>)) {
    let LastRounding { steps, step, is_last, offsets } = rounded;
    let Quantisation { base, factor_log2, exponents, contributions } = steps;
    let n = exponents.len();
    put("rounded.step", Tensor::u32(&[2], vec![*step, u32::from(*is_last)]));
    put("rounded.steps", Tensor::new(&[12], Data::F64(numbers(base).to_vec())));
    put("rounded.factor_log2", Tensor::new(&[1], Data::F64(vec![*factor_log2])));
    put("rounded.exponents", Tensor::new(&[n], Data::I16(exponents.iter().map(|&x| x.into()).collect())));
    put("rounded.contributions", Tensor::f32(&[n], contributions));
    put_arrays("rounded.offsets", &offsets.splats, put);
    put("rounded.offsets.texels", Tensor::f32(&[offsets.texels.len() / 3, 3], &offsets.texels));
    put("rounded.offsets.texel_sizes", Tensor::f32(&[n, 2], &offsets.texel_sizes));
}

/// The tensors of splats of these SH degrees, if the checkpoint has them.
pub fn take(reader: &mut Reader<'_>, degrees: &[u8], num_texels: usize) -> Result<Option<LastRounding>> {
    if !reader.has("rounded.step") {
        return Ok(None);
    }
    let n = degrees.len();
    let of_run = u32s(reader.take("rounded.step", Dtype::U32, &[2])?);
    let numbers = f64s(reader.take("rounded.steps", Dtype::F64, &[12])?);
    let factor_log2 = f64s(reader.take("rounded.factor_log2", Dtype::F64, &[1])?)[0];
    let exponents = i16s(reader.take("rounded.exponents", Dtype::I16, &[n])?);
    let contributions = f32s(reader.take("rounded.contributions", Dtype::F32, &[n])?);
    let offsets = Offsets {
        splats: arrays(reader, "rounded.offsets", degrees)?,
        texels: f32s(reader.take("rounded.offsets.texels", Dtype::F32, &[num_texels, 3])?),
        texel_sizes: f32s(reader.take("rounded.offsets.texel_sizes", Dtype::F32, &[n, 2])?),
    };
    let base = steps(&numbers);
    if base.scaled(factor_log2.exp2()).validate().is_err() {
        return Err(reader.invalid(format!(
            "tensors \"rounded.steps\" and \"rounded.factor_log2\": found {numbers:?} and {factor_log2}, expected steps in \
             [2^-30, 16] after multiplication by the power of two"
        )));
    }
    let exponents = exponents.into_iter().map(|x| {
        i8::try_from(x).map_err(|_| {
            reader.invalid(format!("tensor \"rounded.exponents\": found {x}, expected -128 to 127"))
        })
    });
    let steps =
        Quantisation { base, factor_log2, exponents: exponents.collect::<Result<_>>()?, contributions };
    Ok(Some(LastRounding { steps, step: of_run[0], is_last: of_run[1] != 0, offsets }))
}

/// Steps as numbers.
fn numbers(steps: &Steps) -> [f64; 12] {
    let &Steps {
        position,
        tilt,
        twist,
        log2_scale,
        log2_opacity,
        sh0,
        sh_rest,
        texel,
        chroma,
        log2_texel_size,
    } = steps;
    let [sh1, sh2, sh3] = sh_rest;
    [position, tilt, twist, log2_scale, log2_opacity, sh0, sh1, sh2, sh3, texel, chroma, log2_texel_size]
}

/// The inverse of [`numbers`]. `[12]`
fn steps(n: &[f64]) -> Steps {
    Steps {
        position: n[0],
        tilt: n[1],
        twist: n[2],
        log2_scale: n[3],
        log2_opacity: n[4],
        sh0: n[5],
        sh_rest: [n[6], n[7], n[8]],
        texel: n[9],
        chroma: n[10],
        log2_texel_size: n[11],
    }
}
