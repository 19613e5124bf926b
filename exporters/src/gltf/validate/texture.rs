//! Rules about our extension: its properties, rectangles and pages.

use super::{Issues, text_of};
use crate::atlas::Atlas;
use crate::gltf::extension::TextureExtension;
use crate::gltf::loaded::Loaded;
use crate::gltf::scene::Found;
use crate::gltf::{EXTENSION, KHR, VERSION, pages};
use crate::{AssetMap, Quality, Severity};
use serde_json::Value;

/// Everything but the hash, which is that of the whole content.
pub fn check(loaded: &Loaded<'_>, found: &Found<'_>, value: &Value, issues: &mut Issues) {
    let place = format!("{}/extensions/{KHR}/extensions/{EXTENSION}", found.pointer);
    let extension = match TextureExtension::parse(value, loaded.path) {
        Ok(extension) => extension,
        Err(e) => {
            let of_version = value.get("version").and_then(Value::as_u64) != Some(u64::from(VERSION));
            return issues.error(if of_version { "LT1020" } else { "LT1021" }, &place, text_of(e));
        }
    };
    match Quality::from_name(&extension.quality) {
        Some(Quality::Lossless | Quality::Balanced) => {}
        _ => {
            let what = format!("{:?}, known: \"lossless\", \"balanced\"", extension.quality);
            issues.push("LT1021", Severity::Warning, &format!("{place}/quality"), what);
        }
    }
    if extension.hash().is_none() {
        let what = format!("{:?}, expected 16 hexadecimal digits", extension.hash);
        issues.error("LT1021", &format!("{place}/hash"), what);
    }
    let position = found.primitive.attributes.get("POSITION");
    let position = position.and_then(|&i| loaded.accessor(i, "POSITION").ok());
    let Some(num_splats) = position.map(|view| view.count) else {
        // Told before.
        return;
    };
    match pages::layout(loaded, &extension, num_splats) {
        Ok(None) => {}
        Ok(Some((atlas, maps))) => {
            if let Some(what) = overlap(&atlas, &maps) {
                issues.error("LT1023", &format!("{place}/rects"), what);
            }
            check_sizes(&maps, &format!("{place}/texelSize"), issues);
        }
        Err(e) => {
            let text = text_of(e);
            let code = match () {
                () if text.contains("overlap") => "LT1023",
                () if text.starts_with("map of splat") => "LT1022",
                () if text.starts_with("atlas page") => "LT1024",
                () => "LT1021",
            };
            // Pages of odd sizes are not read.
            return issues.error(code, &format!("{place}/rects"), text);
        }
    }
    for (i, page) in extension.atlas.iter().enumerate() {
        let page_place = format!("{place}/atlas/{i}");
        match pages::page_texels(loaded, page, extension.decode, i) {
            Ok(texels) if !texels.iter().all(|t| (-1.0..=1.0).contains(t)) => {
                issues.error("LT1024", &page_place, "texels that are not in [-1, 1]");
            }
            Ok(_) => {}
            Err(e) => issues.error("LT1024", &page_place, text_of(e)),
        }
    }
}

/// Texel sizes and rectangles say alike which splats have a map.
fn check_sizes(maps: &[AssetMap], place: &str, issues: &mut Issues) {
    let offends = |map: &AssetMap| match map.num_texels() {
        0 => map.texel_size != 0.0 || map.rows != 0 || map.cols != 0,
        _ => !(map.texel_size > 0.0 && map.texel_size.is_finite()),
    };
    let offences = maps.iter().enumerate().filter(|(_, map)| offends(map));
    let text = |(i, map): (usize, &AssetMap)| {
        format!("splat {i}: texels of size {} in a map of {} x {}", map.texel_size, map.rows, map.cols)
    };
    issues.many("LT1021", place, offences.map(text));
}

/// The first overlap: every texel of every page is painted once at most. Rectangles lie on their pages.
fn overlap(atlas: &Atlas, maps: &[AssetMap]) -> Option<String> {
    let texels = |p: &[u16; 2]| usize::from(p[0]) * usize::from(p[1]);
    // The areas were compared before: all maps together are no larger than the pages.
    let mut painted: Vec<Vec<u64>> = vec![Vec::new(); atlas.pages.len()];
    for (splat, (map, at)) in maps.iter().zip(&atlas.placements).enumerate() {
        if map.num_texels() == 0 {
            continue;
        }
        let page = atlas.pages.get(usize::from(at.page))?;
        let bits = painted.get_mut(usize::from(at.page))?;
        bits.resize(texels(page).div_ceil(64), 0);
        for row in 0..usize::from(map.rows) {
            let first = (usize::from(at.y) + row) * usize::from(page[0]) + usize::from(at.x);
            for texel in first..first + usize::from(map.cols) {
                let (word, bit) = (bits.get_mut(texel / 64)?, 1 << (texel % 64));
                if *word & bit != 0 {
                    return Some(format!(
                        "the rectangle of splat {splat} on page {} overlaps another",
                        at.page
                    ));
                }
                *word |= bit;
            }
        }
    }
    None
}
