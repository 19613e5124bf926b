//! Reads the attributes of splats: bit for bit from our files, converted to discs from others.

use super::accessor::{Component, View};
use super::document::Primitive;
use super::loaded::Loaded;
use super::{KHR, sh_attribute, sh_indices};
use crate::fallback::broken::BrokenSplats;
use crate::fallback::ellipsoid;
use crate::files::limits::{filled, room_for_splats, splat_bytes};
use crate::math::yup;
use crate::{AssetMap, Error, Result, SplatAsset};

/// The attributes of splats.
pub struct Attributes<'a> {
    pub sh_degree: u32,
    pub num_splats: usize,
    position: View<'a>,
    rotation: View<'a>,
    scale: View<'a>,
    opacity: View<'a>,
    /// In the order of assets. `[(sh_degree + 1)^2]`
    sh: Vec<View<'a>>,
}

/// Types that an attribute may have, besides f32.
struct Allowed {
    width: usize,
    components: &'static [Component],
    /// Whether integers must be normalised.
    normalised: Option<bool>,
}

impl Allowed {
    fn accepts(&self, view: &View<'_>) -> bool {
        let whole = self.components.contains(&view.component)
            && self.normalised.is_none_or(|normalised| normalised == view.normalised);
        view.width == self.width && (view.component == Component::F32 && !view.normalised || whole)
    }
}

/// The types that `KHR_gaussian_splatting` and `KHR_mesh_quantization` allow for an attribute.
fn allowed(name: &str) -> Allowed {
    use Component::{I8, I16, U8, U16};
    let of = |width, components, normalised| Allowed { width, components, normalised };
    match name.strip_prefix(KHR).unwrap_or(name) {
        "POSITION" => of(3, &[I8, U8, I16, U16], None),
        ":ROTATION" => of(4, &[I8, I16], Some(true)),
        ":SCALE" => of(3, &[U8, U16], None),
        ":OPACITY" => of(1, &[U8, U16], Some(true)),
        _ => of(3, &[], None),
    }
}

/// The data of an attribute, of a type that the specification allows.
///
/// # Errors
/// [`Error::Invalid`] if it is missing, of another type, or does not lie in its buffer.
pub fn attribute<'a>(loaded: &'a Loaded<'_>, primitive: &Primitive, name: &str) -> Result<View<'a>> {
    let index = primitive.attributes.get(name);
    let index = *index.ok_or_else(|| invalid!(loaded.path, "attribute {name} is missing"))?;
    let view = loaded.accessor(index, name)?;
    if !allowed(name).accepts(&view) {
        let what = format!(
            "attribute {name}: {} numbers of {:?}{} per splat, which the specification does not allow",
            view.width,
            view.component,
            if view.normalised { " normalised" } else { "" }
        );
        return Err(Error::invalid(loaded.path, what));
    }
    Ok(view)
}

/// The highest SH degree of which a coefficient is there.
pub fn sh_degree(primitive: &Primitive) -> u32 {
    let any = |l: u32| (0..=2 * l).any(|n| primitive.attributes.contains_key(&sh_attribute(l, n)));
    (0..=3).rev().find(|&l| any(l)).unwrap_or(0)
}

impl<'a> Attributes<'a> {
    /// The attributes of a primitive of splats.
    ///
    /// # Errors
    /// As [`attribute`]; [`Error::Invalid`] if the counts differ, [`Error::TooLarge`].
    pub fn find(loaded: &'a Loaded<'_>, primitive: &Primitive) -> Result<Self> {
        let get = |name: &str| attribute(loaded, primitive, name);
        let sh_degree = sh_degree(primitive);
        let position = get("POSITION")?;
        let num_splats = position.count;
        let found = Self {
            sh_degree,
            num_splats,
            position,
            rotation: get(&format!("{KHR}:ROTATION"))?,
            scale: get(&format!("{KHR}:SCALE"))?,
            opacity: get(&format!("{KHR}:OPACITY"))?,
            sh: sh_indices(sh_degree).map(|(l, n)| get(&sh_attribute(l, n))).collect::<Result<_>>()?,
        };
        let counts = [("ROTATION", &found.rotation), ("SCALE", &found.scale), ("OPACITY", &found.opacity)];
        let named = counts.into_iter().chain(found.sh.iter().map(|view| ("SH", view)));
        if let Some((name, view)) = named.into_iter().find(|(_, view)| view.count != num_splats) {
            let what = format!("attribute {KHR}:{name}: {} elements for {num_splats} splats", view.count);
            return Err(Error::invalid(loaded.path, what));
        }
        loaded.take_bytes(num_splats as u64 * splat_bytes(sh_degree), "splats")?;
        Ok(found)
    }

    /// The splats of our files, bit for bit, without maps; the third scale is not read.
    ///
    /// # Errors
    /// [`Error::Invalid`] for rotations that are not unit quaternions.
    pub fn surfels(&self, loaded: &Loaded<'_>) -> Result<SplatAsset> {
        let mut asset = self.room(loaded)?;
        asset.maps.resize(self.num_splats, AssetMap::default());
        for (splat, [x, y, z, w]) in self.rotation.rows::<4>().enumerate() {
            let q = ellipsoid::unit([w, x, y, z]).ok_or_else(|| {
                let what =
                    format!("splat {splat}: rotation {:?} (xyzw) is not a unit quaternion", [x, y, z, w]);
                Error::invalid(loaded.path, what)
            })?;
            asset.rotations.push(yup::rotation_back(q));
        }
        asset.scales.extend(self.scale.rows::<2>());
        asset.opacities.extend(self.opacity.rows().map(|[o]| o));
        Ok(asset)
    }

    /// An asset with positions and SH, and room for the rest.
    fn room(&self, loaded: &Loaded<'_>) -> Result<SplatAsset> {
        let mut asset = room_for_splats(self.num_splats, self.sh_degree).map_err(|e| e.at(loaded.path))?;
        asset.positions.extend(self.position.rows().map(yup::position));
        asset.sh = self.sh_coefficients().map_err(|e| e.at(loaded.path))?;
        asset.sh_degrees.resize(self.num_splats, self.sh_degree as u8);
        Ok(asset)
    }

    /// Ellipsoids as discs along their two largest axes, how many of them are thick, and those with numbers that the
    /// specification forbids.
    ///
    /// # Errors
    /// [`Error::TooLarge`].
    pub fn flattened(&self, loaded: &Loaded<'_>) -> Result<(SplatAsset, usize, BrokenSplats)> {
        let mut asset = self.room(loaded)?;
        let (mut num_thick, mut broken) = (0, BrokenSplats::default());
        let rows = self.rotation.rows::<4>().zip(self.scale.rows::<3>()).zip(self.opacity.rows::<1>());
        for (splat, (([x, y, z, w], scales), [opacity])) in rows.enumerate() {
            match ellipsoid::push(&mut asset, [w, x, y, z], scales, opacity) {
                Ok(is_thick) => num_thick += usize::from(broken.is_sound(&asset, splat) && is_thick),
                Err(what) => {
                    ellipsoid::push_nothing(&mut asset);
                    broken.add(splat, &what);
                }
            }
        }
        Ok((asset, num_thick, broken))
    }

    /// The first splat whose coefficients of degree 0 are not all finite.
    pub fn first_dc_not_finite(&self) -> Option<usize> {
        self.sh.first()?.rows::<3>().position(|dc| !dc.iter().all(|v| v.is_finite()))
    }

    /// SH coefficients in the local frame. `[n, (sh_degree + 1)^2, 3]`
    fn sh_coefficients(&self) -> Result<Vec<f32>> {
        let width = 3 * self.sh.len();
        let mut sh = filled(self.num_splats * width, 0.0)?;
        for (k, view) in self.sh.iter().enumerate() {
            let places = sh.chunks_exact_mut(width).filter_map(|c| c.get_mut(3 * k..3 * k + 3));
            for (place, row) in places.zip(view.rows::<3>()) {
                place.copy_from_slice(&row.map(|c| yup::SH_SIGNS[k] * c));
            }
        }
        Ok(sh)
    }
}
