//! Reads the arrays of a particle field.

use super::layer::Prim;
use super::names::*;
use super::value::{Form, Numbers, Value};
use crate::atlas::{Atlas, PAGE_SIDE_MAX, Placement, TexelDecode};
use crate::files::limits::{splat_bytes, with_room};
use crate::math::yup;
use crate::{AssetMap, Error, ReadLimits, Result, SPLATS_MAX, SplatAsset, num_sh_coefficients};
use std::path::Path;

/// Most pages of a file.
const PAGES_MAX: usize = 1000;

/// A prim that is read as a particle field.
pub(super) struct Field<'a> {
    pub(super) path: &'a Path,
    pub(super) prim: &'a Prim,
}

impl Field<'_> {
    fn wrong<T>(&self, name: &str, expected: &str) -> Result<T> {
        let found = match self.prim.value(name) {
            None => "missing",
            Some(_) => "of another type or length",
        };
        Err(invalid!(self.path, "{name}: {found}, expected {expected}"))
    }

    pub(super) fn floats(&self, name: &str, form: Form, count: usize) -> Result<&[f32]> {
        match self.prim.value(name) {
            Some(Value::Floats(n)) if n.is_array && n.form == form && n.num_elements() == count => {
                Ok(&n.values)
            }
            _ => self.wrong(name, &format!("an array of {count} floats ({form:?})")),
        }
    }

    fn ints(&self, name: &str, form: Form, count: usize) -> Result<&[i32]> {
        match self.prim.value(name) {
            Some(Value::Ints(n)) if n.is_array && n.form == form && n.num_elements() == count => {
                Ok(&n.values)
            }
            _ => self.wrong(name, &format!("an array of {count} integers ({form:?})")),
        }
    }

    fn int(&self, name: &str) -> Result<i32> {
        match self.prim.value(name).and_then(Value::as_int) {
            Some(value) => Ok(value),
            None => self.wrong(name, "an integer"),
        }
    }

    /// Centres, y up, and SH degree, as many as the limits allow.
    pub(super) fn splats(&self, limits: &ReadLimits) -> Result<(&[[f32; 3]], u32)> {
        let Some(Value::Floats(Numbers { form: Form::Vec3, is_array: true, values })) =
            self.prim.value(POSITIONS)
        else {
            return self.wrong(POSITIONS, "an array of points");
        };
        let Some(degree) = u32::try_from(self.int(SH_DEGREE)?).ok().filter(|&d| d <= 3) else {
            return self.wrong(SH_DEGREE, "0 to 3");
        };
        let positions = values.as_chunks::<3>().0;
        let n = positions.len();
        if n > SPLATS_MAX {
            return Err(too_large!(self.path, "{n} splats, at most {SPLATS_MAX}"));
        }
        limits.check(splat_bytes(degree) * n as u64, &format!("{n} splats"), self.path)?;
        Ok((positions, degree))
    }

    /// Stores everything but the texels in an asset.
    pub(super) fn store(&self, asset: &mut SplatAsset, limits: &ReadLimits) -> Result<()> {
        let version = self.int(LITETEX_VERSION)?;
        if version != VERSION {
            return Err(unsupported!(self.path, "{LITETEX_VERSION} {version}; supported: {VERSION}"));
        }
        let (positions, degree) = self.splats(limits)?;
        let n = positions.len();
        let num_coefficients = num_sh_coefficients(degree);
        asset.sh_degree = degree;
        asset.positions = positions.iter().map(|&p| yup::position(p)).collect();
        let rotations = self.floats(ORIENTATIONS, Form::Quaternion, n)?.as_chunks::<4>().0;
        asset.rotations = rotations.iter().map(|&q| yup::rotation_back(q)).collect();
        let scales = self.floats(SCALES, Form::Vec3, n)?.as_chunks::<3>().0;
        asset.scales = scales.iter().map(|&[u, v, _]| [u, v]).collect();
        asset.opacities = self.floats(OPACITIES, Form::One, n)?.to_vec();
        let sh = self.floats(SH_COEFFICIENTS, Form::Vec3, n * num_coefficients)?;
        let sh0 = self.floats(SH0, Form::Vec3, n)?;
        let is_finite = |all: &[f32]| all.iter().take(3).all(|v| v.is_finite());
        if let Some(splat) = sh.chunks_exact(3 * num_coefficients).position(|all| !is_finite(all)) {
            let what =
                format!("{SH_COEFFICIENTS} of splat {splat}: degree 0 for other programs is not finite");
            return Err(Error::invalid(self.path, what));
        }
        asset.sh = with_room(sh.len()).map_err(|e| e.at(self.path))?;
        for (all, first) in sh.chunks_exact(3 * num_coefficients).zip(sh0.chunks_exact(3)) {
            asset.sh.extend_from_slice(first);
            asset.sh.extend(yup::sh(all).skip(3));
        }
        let degrees = self.sh_degrees(n, degree)?;
        asset.store_sh_degrees(degrees).map_err(|e| e.at(self.path))?;
        asset.maps = self.maps(n)?;
        Ok(())
    }

    /// SH degrees of `n` splats, at most `most`.
    fn sh_degrees(&self, n: usize, most: u32) -> Result<Vec<u8>> {
        if self.prim.value(OWN_SH_DEGREE).is_none() {
            return crate::files::limits::filled(n, most as u8).map_err(|e| e.at(self.path));
        }
        let degrees = self.ints(OWN_SH_DEGREE, Form::One, n)?.iter().map(|&degree| u8::try_from(degree));
        let what = |_| invalid!(self.path, "{OWN_SH_DEGREE}: not all are 0 to {most}");
        degrees.collect::<Result<_, _>>().map_err(what)
    }

    /// Maps of `n` splats: their sides, and where their texels will stand.
    pub(super) fn maps(&self, n: usize) -> Result<Vec<AssetMap>> {
        let rects = self.ints(RECT, Form::Vec4, n)?.as_chunks::<4>().0;
        let texel_sizes = self.floats(TEXEL_SIZE, Form::Vec2, n)?.as_chunks::<2>().0;
        let mut shifts = self.shifts(n)?.iter();
        let mut maps = with_room(n).map_err(|e| e.at(self.path))?;
        let mut offset = 0_u64;
        for (splat, (&[_, _, cols, rows], &texel_sizes)) in rects.iter().zip(texel_sizes).enumerate() {
            let sides = [rows, cols].map(u16::try_from);
            let (Ok(rows), Ok(cols), true) = (sides[0], sides[1], (rows == 0) == (cols == 0)) else {
                return Err(invalid!(self.path, "{RECT} of splat {splat}: {rows} x {cols} texels"));
            };
            let offset_texels = u32::try_from(offset)
                .map_err(|_| too_large!(self.path, "{offset} texels, at most {}", u32::MAX))?;
            let [Ok(shift_u), Ok(shift_v)] = shifts.next().copied().unwrap_or_default().map(i16::try_from)
            else {
                return Err(invalid!(self.path, "{SHIFT} of splat {splat}: beyond 16 bits"));
            };
            maps.push(AssetMap { offset_texels, rows, cols, texel_sizes, shift: [shift_u, shift_v] });
            offset += u64::from(rows) * u64::from(cols);
        }
        Ok(maps)
    }

    /// Shifts of `n` maps; none if all are centred.
    fn shifts(&self, n: usize) -> Result<&[[i32; 2]]> {
        match self.prim.value(SHIFT) {
            None => Ok(&[]),
            Some(_) => Ok(self.ints(SHIFT, Form::Vec2, n)?.as_chunks::<2>().0),
        }
    }

    /// Where the maps of `n` splats lie, not checked yet.
    pub(super) fn atlas(&self, n: usize) -> Result<Atlas> {
        Ok(Atlas { placements: self.placements(n)?, pages: self.page_sizes()?, border: 0 })
    }

    fn placements(&self, n: usize) -> Result<Vec<Placement>> {
        let rects = self.ints(RECT, Form::Vec4, n)?.as_chunks::<4>().0;
        let pages = self.ints(PAGE, Form::One, n)?;
        let mut placements = Vec::with_capacity(n);
        for (splat, (&[x, y, ..], &page)) in rects.iter().zip(pages).enumerate() {
            let [Ok(page), Ok(x), Ok(y)] = [page, x, y].map(u16::try_from) else {
                let what = format!("{RECT} of splat {splat}: column {x}, row {y} of page {page}");
                return Err(Error::invalid(self.path, what));
            };
            placements.push(Placement { page, x, y });
        }
        Ok(placements)
    }

    fn page_sizes(&self) -> Result<Vec<[u16; 2]>> {
        let Some(Value::Ints(Numbers { form: Form::Vec2, is_array: true, values })) =
            self.prim.value(PAGE_SIZES)
        else {
            return self.wrong(PAGE_SIZES, "an array of widths and heights");
        };
        let pages = values.as_chunks::<2>().0;
        if pages.len() > PAGES_MAX {
            return Err(too_large!(self.path, "{} pages, at most {PAGES_MAX}", pages.len()));
        }
        let side = |s: i32| u16::try_from(s).ok().filter(|s| (1..=PAGE_SIDE_MAX).contains(s));
        let mut sizes = Vec::new();
        for &[width, height] in pages {
            let (Some(width), Some(height)) = (side(width), side(height)) else {
                let what = format!("{PAGE_SIZES}: {width} x {height}, sides of 1 to {PAGE_SIDE_MAX}");
                return Err(Error::invalid(self.path, what));
            };
            sizes.push([width, height]);
        }
        Ok(sizes)
    }

    /// How codes become texels; `None` if pages hold floats.
    pub(super) fn decode(&self) -> Result<Option<TexelDecode>> {
        let [scale, bias] = [DECODE_SCALE, DECODE_BIAS].map(|name| self.prim.value(name));
        match (scale, bias) {
            (None, None) => Ok(None),
            (Some(scale), Some(bias)) => match (scale.as_double(), bias.as_double()) {
                (Some(scale), Some(bias)) if scale.is_finite() && bias.is_finite() => {
                    Ok(Some(TexelDecode { scale, bias }))
                }
                _ => self.wrong(DECODE_SCALE, "a finite double, as decodeBias"),
            },
            _ => self.wrong(DECODE_SCALE, "both decodeScale and decodeBias or none"),
        }
    }
}
