//! Reads rectangles and atlas pages of our extension.

use super::accessor::{Component, View};
use super::document::{Image, MIME_PNG};
use super::extension::{Decode, Page, TextureExtension};
use super::loaded::Loaded;
use crate::atlas::{Atlas, PAGE_SIDE_MAX, Placement, TexelDecode, decode_exr, decode_png};
use crate::limits::filled;
use crate::{AssetMap, Error, Result, SplatAsset};
use std::borrow::Cow;

/// Most pages: an index has 16 bits.
const PAGES_MAX: usize = 1 << 16;

/// What deflate makes of a byte at most; PNG and our EXR use it.
const EXPANSION_MAX: u64 = 1040;

/// Reads maps and texels into an asset that has its splats.
///
/// # Errors
/// [`Error::Invalid`], [`Error::TooLarge`], and those of files beside the `.gltf`.
pub fn read_maps(loaded: &Loaded<'_>, extension: &TextureExtension, asset: &mut SplatAsset) -> Result<()> {
    let Some((atlas, maps)) = layout(loaded, extension, asset.num_splats())? else {
        return Ok(());
    };
    asset.maps = maps;
    // Texels are counted once; check_area has bound them by the pages.
    let texels: u64 = asset.maps.iter().map(|m| m.num_texels() as u64).sum();
    loaded.take_bytes(12 * texels, "texels")?;
    asset.texels = filled(3 * texels as usize, 0.0).map_err(|e| e.at(loaded.path))?;
    // One page at a time, and every splat once.
    let mut by_page: Vec<u32> = (0..asset.maps.len() as u32).collect();
    by_page.sort_by_key(|&splat| atlas.placements[splat as usize].page);
    let mut rest = by_page.as_slice();
    for (i, page) in extension.atlas.iter().enumerate() {
        let texels = page_texels(loaded, page, extension.decode, i)?;
        let end = rest.partition_point(|&splat| usize::from(atlas.placements[splat as usize].page) <= i);
        let (on_page, others) = rest.split_at(end);
        copy_maps(&atlas, on_page, &texels, asset);
        rest = others;
    }
    Ok(())
}

/// Where the maps lie; `None` if there are none. All is checked except for overlaps.
///
/// # Errors
/// [`Error::Invalid`], [`Error::TooLarge`].
pub fn layout(
    loaded: &Loaded<'_>,
    extension: &TextureExtension,
    num_splats: usize,
) -> Result<Option<(Atlas, Vec<AssetMap>)>> {
    let offence = |what: String| Error::invalid(loaded.path, format!("{}: {what}", super::EXTENSION));
    let (rects, sizes) = match (extension.rects, extension.texel_size) {
        (None, None) => return Ok(None),
        (Some(rects), Some(sizes)) => (rects, sizes),
        _ => return Err(offence("one of \"rects\" and \"texelSize\" without the other".to_owned())),
    };
    let own = |index: u32, what: &str, width: usize, components: &[Component]| {
        let view = loaded.accessor(index, what)?;
        let fits = view.width == width && components.contains(&view.component) && !view.normalised;
        if !fits || view.count != num_splats {
            return Err(offence(format!(
                "{what}: {} elements of {} {:?}, expected {num_splats} of {width}, each one of {components:?}",
                view.count, view.width, view.component
            )));
        }
        Ok::<View<'_>, Error>(view)
    };
    let rects = own(rects, "rects", 4, &[Component::U16])?;
    let sizes = own(sizes, "texelSize", 1, &[Component::F32])?;
    let pages = extension.pages.map(|p| own(p, "pages", 1, &[Component::U8, Component::U16])).transpose()?;
    let mut atlas =
        Atlas { placements: Vec::with_capacity(num_splats), pages: page_sizes(loaded, extension)? };
    let mut maps = Vec::with_capacity(num_splats);
    let mut next = 0_u64;
    let mut page_of = pages.iter().flat_map(|p| p.rows::<1>());
    for ([x, y, cols, rows], [texel_size]) in rects.rows::<4>().zip(sizes.rows::<1>()) {
        // Whole numbers below 2^16: exact.
        let map = AssetMap {
            offset_texels: u32::try_from(next)
                .map_err(|_| Error::too_large(loaded.path, format!("more than {} texels", u32::MAX)))?,
            rows: rows as u16,
            cols: cols as u16,
            texel_size,
        };
        next += map.num_texels() as u64;
        let page = page_of.next().map_or(0, |[p]| p as u16);
        atlas.placements.push(Placement { page, x: x as u16, y: y as u16 });
        maps.push(map);
    }
    atlas.check(&maps).map_err(|e| e.at(loaded.path))?;
    let area: u64 = atlas.pages.iter().map(|p| u64::from(p[0]) * u64::from(p[1])).sum();
    if next > area {
        return Err(offence(format!("{next} texels on pages of {area}: rectangles overlap")));
    }
    Ok(Some((atlas, maps)))
}

/// `[width, height]` of the pages.
fn page_sizes(loaded: &Loaded<'_>, extension: &TextureExtension) -> Result<Vec<[u16; 2]>> {
    let count = extension.atlas.len();
    if count > PAGES_MAX {
        return Err(Error::too_large(loaded.path, format!("{count} atlas pages, at most {PAGES_MAX}")));
    }
    let size = |(i, page): (usize, &Page)| {
        let side = |v: u32| u16::try_from(v).ok().filter(|v| (1..=PAGE_SIDE_MAX).contains(v));
        side(page.width).zip(side(page.height)).map(|(w, h)| [w, h]).ok_or_else(|| {
            let what = format!(
                "atlas page {i}: {} x {} texels, expected 1 to {PAGE_SIDE_MAX} a side",
                page.width, page.height
            );
            Error::too_large(loaded.path, what)
        })
    };
    extension.atlas.iter().enumerate().map(size).collect()
}

/// Texels of a page. `[height, width, 3]`
///
/// # Errors
/// [`Error::Invalid`] if it is damaged or of another size, [`Error::TooLarge`], and those of files beside the `.gltf`.
pub fn page_texels<'a>(
    loaded: &'a Loaded<'_>,
    page: &Page,
    decode: Option<Decode>,
    index: usize,
) -> Result<Cow<'a, [f32]>> {
    decoded_texels(loaded, page, decode, index).map_err(|error| match (error, file_of(loaded, page)) {
        (Error::Invalid { path, what }, Some(uri)) => {
            Error::invalid(path, format!("{what} (file {:?})", super::shown(uri)))
        }
        (error, _) => error,
    })
}

fn decoded_texels<'a>(
    loaded: &'a Loaded<'_>,
    page: &Page,
    decode: Option<Decode>,
    index: usize,
) -> Result<Cow<'a, [f32]>> {
    let what = format!("atlas page {index}");
    let offence = |text: &str| Error::invalid(loaded.path, format!("{what}: {text}"));
    // Sizes were checked by `page_sizes`.
    let size = [page.width as u16, page.height as u16];
    let texels = u64::from(page.width) * u64::from(page.height);
    let enough = |stored: usize, unpacked: u64, decoded: u64| {
        if unpacked > EXPANSION_MAX * stored as u64 + 4096 {
            return Err(offence(&format!("{stored} bytes cannot hold {} x {} texels", size[0], size[1])));
        }
        loaded.take_bytes(decoded, &what)
    };
    match (page.buffer_view, page.texture, &page.uri) {
        (Some(view), None, None) => {
            let (_, bytes) = loaded.view(view, &what)?;
            if bytes.len() as u64 != 12 * texels {
                return Err(offence(&format!("{} bytes, expected {} of f32 RGB", bytes.len(), 12 * texels)));
            }
            loaded.take_bytes(12 * texels, &what)?;
            let float = |b: &[u8; 4]| f32::from_le_bytes(*b);
            Ok(bytes.as_chunks().0.iter().map(float).collect())
        }
        (None, None, Some(uri)) => {
            let bytes = loaded.side_file(uri)?;
            enough(bytes.len(), 12 * texels, 12 * texels)?;
            Ok(decode_exr(&bytes, size, loaded.path)?.into())
        }
        (None, Some(texture), None) => {
            let decode = decode.ok_or_else(|| offence("8 bits without \"decode\""))?;
            let decode = TexelDecode { scale: decode.scale, bias: decode.bias };
            if !(decode.scale.is_finite() && decode.scale > 0.0 && decode.bias.is_finite()) {
                return Err(offence(&format!("{decode:?}: finite, the scale positive")));
            }
            let bytes = image_bytes(loaded, texture, &what)?;
            // Codes, and the floats that they become.
            enough(bytes.len(), 3 * texels, 15 * texels)?;
            let codes = decode_png(&bytes, size, loaded.path)?;
            let table: Vec<f32> = (0..=u8::MAX).map(|code| decode.texel(code)).collect();
            Ok(codes.iter().map(|&code| table[usize::from(code)]).collect())
        }
        _ => Err(offence("expected exactly one of \"bufferView\", \"texture\" and \"uri\"")),
    }
}

/// The PNG of a core texture.
fn image_bytes<'a>(loaded: &'a Loaded<'_>, texture: u32, what: &str) -> Result<Cow<'a, [u8]>> {
    let offence = |text: &str| Error::invalid(loaded.path, format!("{what}: {text}"));
    let document = &loaded.document;
    let source = document.textures.get(texture as usize).and_then(|t| t.source);
    let image = source.and_then(|s| document.images.get(s as usize));
    let image = image.ok_or_else(|| offence(&format!("texture {texture} without an image")))?;
    if let Some(kind) = image.mime_type.as_ref().filter(|m| m.as_str() != MIME_PNG) {
        let kind = super::shown(kind);
        let text = format!("an image of type {kind:?}; residuals must be kept as PNG");
        return Err(Error::unsupported(loaded.path, format!("{what}: {text}")));
    }
    match (image.buffer_view, &image.uri) {
        (Some(view), None) => Ok(Cow::Borrowed(loaded.view(view, what)?.1)),
        (None, Some(uri)) => loaded.side_file(uri).map(Cow::Owned),
        _ => Err(offence("an image with neither or both of bufferView and uri")),
    }
}

/// Bytes of a page in its file.
pub fn stored_bytes(loaded: &Loaded<'_>, page: &Page) -> u64 {
    let view = |index: u32| loaded.view(index, "").map_or(0, |(_, bytes)| bytes.len() as u64);
    let of_image = image_of(loaded, page).and_then(|image| image.buffer_view);
    match page.buffer_view.or(of_image) {
        Some(index) => view(index),
        None => file_of(loaded, page).map_or(0, |uri| loaded.side_file_bytes(uri)),
    }
}

/// The image of a page that is a core texture.
fn image_of<'a>(loaded: &'a Loaded<'_>, page: &Page) -> Option<&'a Image> {
    let document = &loaded.document;
    let source = document.textures.get(page.texture? as usize)?.source?;
    document.images.get(source as usize)
}

/// URI of a page that is a file.
fn file_of<'a>(loaded: &'a Loaded<'_>, page: &'a Page) -> Option<&'a str> {
    page.uri.as_deref().or_else(|| image_of(loaded, page)?.uri.as_deref())
}

/// Copies the maps of the splats that lie on one page.
fn copy_maps(atlas: &Atlas, splats: &[u32], texels: &[f32], asset: &mut SplatAsset) {
    for &splat in splats {
        let (map, at) = (&asset.maps[splat as usize], &atlas.placements[splat as usize]);
        let width = atlas.pages.get(usize::from(at.page)).map_or(0, |p| usize::from(p[0]));
        let cols = usize::from(map.cols);
        for row in 0..usize::from(map.rows) {
            let from = 3 * ((usize::from(at.y) + row) * width + usize::from(at.x));
            let to = 3 * (map.offset_texels as usize + row * cols);
            let target = asset.texels.get_mut(to..to + 3 * cols);
            if let (Some(target), Some(source)) = (target, texels.get(from..from + 3 * cols)) {
                target.copy_from_slice(source);
            }
        }
    }
}
