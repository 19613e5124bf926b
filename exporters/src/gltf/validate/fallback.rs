//! Rules about what viewers without our extension see: colours with the maps' means, thin discs, coloured points.

use crate::SplatAsset;
use crate::fallback::check::{wrong_dc, wrong_thickness};
use crate::format::contents::Issues;
use crate::gltf::accessor::{Component, View};
use crate::gltf::extension::TextureExtension;
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{KHR, colour, sh_attribute, splats};
use crate::math::yup;

/// Most that a number of a rotation may be off.
const ROTATION_STEP: f32 = 1.0 / 32_767.0;

/// Compares the attributes with the scene that a reader of our extension gets.
pub fn check(loaded: &Loaded<'_>, found: &Found<'_>, asset: &SplatAsset, issues: &mut Issues) {
    let place = |name: &str| format!("{}/attributes/{name}", found.pointer);
    // Missing ones were reported before.
    let attribute = |name: &str| splats::attribute(loaded, found.primitive, name).ok();
    let value = found.splatting.texture();
    let extension = value.and_then(|v| TextureExtension::parse(v, loaded.path).ok());
    if extension.as_ref().is_some_and(|e| e.stream.is_some())
        && let Some(view) = attribute("POSITION")
    {
        let pairs = view.rows::<3>().zip(asset.positions.iter().map(|&p| yup::position(p))).enumerate();
        let apart = pairs.filter(|(_, (found, expected))| found != expected);
        let text = |(splat, (found, expected))| {
            format!("splat {splat}: at {found:?}, in the stream at {expected:?}")
        };
        issues.many("LT1034", &place("POSITION"), apart.map(text));
        check_shapes(loaded, found, asset, issues);
    }
    let zeroth = sh_attribute(0, 0);
    if let Some(view) = attribute(&zeroth) {
        let texel_step = extension.and_then(|e| e.decode).map_or(0.0, |d| d.scale.abs());
        let offences = wrong_dc(asset, view.rows(), texel_step);
        issues.many("LT1031", &place(&zeroth), offences);
    }
    let scale = format!("{KHR}:SCALE");
    if let Some(view) = attribute(&scale) {
        issues.many("LT1032", &place(&scale), wrong_thickness(view.rows()));
    }
    let colours = found.primitive.attributes.get("COLOR_0").and_then(|&i| loaded.accessor(i, "COLOR_0").ok());
    if let Some(view) = colours.filter(|view| view.count == asset.num_splats()) {
        check_colours(&view, asset, &place("COLOR_0"), issues);
    }
}

/// Scales and opacities are those of the stream, and rotations up to a step of 16 bits.
fn check_shapes(loaded: &Loaded<'_>, found: &Found<'_>, asset: &SplatAsset, issues: &mut Issues) {
    let attributes = splats::Attributes::find(loaded, found.primitive);
    let Ok(shown) = attributes.and_then(|attributes| attributes.surfels(loaded)) else { return };
    let is_turned = |a: &[f32; 4], b: &[f32; 4]| a.iter().zip(b).any(|(a, b)| (a - b).abs() > ROTATION_STEP);
    let is_wrong = |&splat: &usize| {
        shown.scales[splat] != asset.scales[splat]
            || shown.opacities[splat].to_bits() != asset.opacities[splat].to_bits()
            || is_turned(&shown.rotations[splat], &asset.rotations[splat])
    };
    let wrong = (0..shown.num_splats().min(asset.num_splats())).filter(is_wrong);
    let text = |splat: usize| format!("splat {splat}: another rotation, scale or opacity than in the stream");
    issues.many("LT1034", &format!("{}/attributes", found.pointer), wrong.map(text));
}

/// Vertex colours are those of degree 0, up to the rounding of their type.
fn check_colours(view: &View<'_>, asset: &SplatAsset, place: &str, issues: &mut Issues) {
    let step = if view.component == Component::U8 { 1.0 / 255.0 } else { 1.0 / 65_535.0 };
    let mut offences = view.rows::<4>().enumerate().filter_map(|(splat, found)| {
        let expected = colour::vertex_colour(asset, splat, asset.untextured_dc(splat));
        let expected = expected.map(|code| f32::from(code) / 65_535.0);
        // Colours of three numbers are opaque.
        let is_near = |c: usize| (found[c] - expected[c]).abs() <= 1.5 * step;
        let text = || format!("splat {splat}: {found:?}, expected {expected:?} from its colour and opacity");
        (!(0..view.width).all(is_near)).then(text)
    });
    if let Some(first) = offences.next() {
        let others = offences.count();
        let what = format!("{first}, and {others} more: viewers without splat support show wrong colours");
        issues.warning("LT1033", place, what);
    }
}
