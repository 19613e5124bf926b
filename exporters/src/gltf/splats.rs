//! Reads the attributes of splats: bit for bit where they are ours, turned into surfels where they are foreign.

use super::accessor::{Component, View};
use super::document::Primitive;
use super::loaded::Loaded;
use super::{KHR, sh_attribute, sh_indices};
use crate::limits::{filled, room_for_splats, splat_bytes};
use crate::ply::thinnest_last;
use crate::{AssetMap, Error, Result, SplatAsset, yup};

/// A quaternion keeps its bits while its norm is within this of 1 (what [`SplatAsset::validate`] allows).
const UNIT_TOLERANCE: f64 = 1e-5;

/// Quaternions of 8 bits are this far off at most; beyond it something else is wrong.
const UNIT_TOLERANCE_STORED: f64 = 0.05;

/// A splat is a disc while its thickness is at most this share of its smaller other scale.
const DISC_THICKNESS: f64 = 0.1;

/// Data of the attributes.
pub struct Attributes<'a> {
    pub sh_degree: u32,
    pub num_splats: usize,
    position: View<'a>,
    rotation: View<'a>,
    scale: View<'a>,
    opacity: View<'a>,
    /// In our order. `[(sh_degree + 1)^2]`
    sh: Vec<View<'a>>,
}

/// Component types that an attribute may have, besides f32.
struct Allowed {
    width: usize,
    components: &'static [Component],
    /// Whether whole numbers must be normalised.
    normalised: Option<bool>,
}

impl Allowed {
    fn accepts(&self, view: &View<'_>) -> bool {
        let whole = self.components.contains(&view.component)
            && self.normalised.is_none_or(|normalised| normalised == view.normalised);
        view.width == self.width && (view.component == Component::F32 && !view.normalised || whole)
    }
}

/// What `KHR_gaussian_splatting` and `KHR_mesh_quantization` allow for an attribute.
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

/// An attribute's data, of a type that the specification allows.
///
/// # Errors
/// [`Error::Invalid`] if it is missing, of another type, or does not lie in its buffer.
pub fn attribute<'a>(loaded: &'a Loaded<'_>, primitive: &Primitive, name: &str) -> Result<View<'a>> {
    let index = primitive.attributes.get(name);
    let index = *index.ok_or_else(|| Error::invalid(loaded.path, format!("attribute {name} is missing")))?;
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

/// Highest degree whose coefficients are there, all or in part.
pub fn sh_degree(primitive: &Primitive) -> u32 {
    let any = |l: u32| (0..=2 * l).any(|n| primitive.attributes.contains_key(&sh_attribute(l, n)));
    (0..=3).rev().find(|&l| any(l)).unwrap_or(0)
}

impl<'a> Attributes<'a> {
    /// Of the primitive of splats.
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

    /// The splats as they are, without maps: the third scale is not read. For files of ours.
    ///
    /// # Errors
    /// [`Error::Invalid`] for rotations that are none.
    pub fn surfels(&self, loaded: &Loaded<'_>) -> Result<SplatAsset> {
        let mut asset = self.room(loaded)?;
        for (i, q) in self.rotation.rows::<4>().enumerate() {
            asset.rotations.push(local_rotation(loaded, i, q)?);
        }
        asset.scales.extend(self.scale.rows::<2>());
        asset.opacities.extend(self.opacity.rows().map(|[o]| o));
        Ok(asset)
    }

    /// Positions, SH and empty maps, and room for the rest.
    fn room(&self, loaded: &Loaded<'_>) -> Result<SplatAsset> {
        let mut asset = room_for_splats(self.num_splats, self.sh_degree).map_err(|e| e.at(loaded.path))?;
        asset.positions.extend(self.position.rows().map(yup::position));
        asset.sh = self.sh_coefficients().map_err(|e| e.at(loaded.path))?;
        asset.maps.resize(self.num_splats, AssetMap::default());
        Ok(asset)
    }

    /// Ellipsoids as surfels along their two largest axes, and how many of them are thick.
    ///
    /// # Errors
    /// [`Error::Invalid`] for numbers that the specification forbids.
    pub fn flattened(&self, loaded: &Loaded<'_>) -> Result<(SplatAsset, usize)> {
        let mut asset = self.room(loaded)?;
        let mut num_thick = 0;
        let rows = self.rotation.rows::<4>().zip(self.scale.rows::<3>()).zip(self.opacity.rows::<1>());
        for (i, ((q, scales), [opacity])) in rows.enumerate() {
            let offence = |what: String| Err(Error::invalid(loaded.path, format!("splat {i}: {what}")));
            if !scales.iter().all(|s| *s >= 0.0 && s.is_finite()) {
                return offence(format!("scales {scales:?} are not finite and at least 0"));
            }
            if !(0.0..=1.0).contains(&opacity) {
                return offence(format!("opacity {opacity} is not in [0, 1]"));
            }
            let [w, x, y, z] = unit(loaded, i, q)?.map(f64::from);
            let (turned, s) = thinnest_last([w, x, y, z], scales.map(f64::from));
            num_thick += usize::from(s[2] > DISC_THICKNESS * s[0].min(s[1]));
            asset.rotations.push(yup::rotation_back(turned.map(|v| v as f32)));
            // What is nothing here is as small as f32 can be, so that the rules of assets hold.
            asset.scales.push([s[0], s[1]].map(|v| (v as f32).max(f32::MIN_POSITIVE)));
            asset.opacities.push(opacity.max(f32::MIN_POSITIVE));
        }
        Ok((asset, num_thick))
    }

    /// The first splat whose coefficients of degree 0 are not all finite.
    pub fn first_dc_not_finite(&self) -> Option<usize> {
        self.sh.first()?.rows::<3>().position(|dc| !dc.iter().all(|v| v.is_finite()))
    }

    /// Coefficients in the local frame. `[n, (sh_degree + 1)^2, 3]`
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

/// `local_from_surfel` wxyz from what is stored, xyzw.
fn local_rotation(loaded: &Loaded<'_>, splat: usize, stored: [f32; 4]) -> Result<[f32; 4]> {
    unit(loaded, splat, stored).map(yup::rotation_back)
}

/// A stored quaternion as wxyz; made a unit one only where it is none.
fn unit(loaded: &Loaded<'_>, splat: usize, [x, y, z, w]: [f32; 4]) -> Result<[f32; 4]> {
    let q = [w, x, y, z];
    let norm = crate::quaternion::norm(q.map(f64::from));
    let off = (norm - 1.0).abs();
    if off <= UNIT_TOLERANCE {
        return Ok(q);
    }
    if off <= UNIT_TOLERANCE_STORED {
        return Ok(q.map(|v| (f64::from(v) / norm) as f32));
    }
    let what = format!("splat {splat}: rotation {:?} (xyzw) is not a unit quaternion", [x, y, z, w]);
    Err(Error::invalid(loaded.path, what))
}
