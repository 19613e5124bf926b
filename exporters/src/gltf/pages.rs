//! Reads rectangles and atlas pages of our extension.

use super::accessor::{Component, View};
use super::document::{Image, MIME_PNG};
use super::extension::{Page, TextureExtension};
use super::loaded::Loaded;
use crate::atlas::{Atlas, MapRows, PAGE_SIDE_MAX, PageRows, Placement, TexelDecode};
use crate::files::limits::{filled, with_room};
use crate::{AssetMap, Error, Result, SplatAsset, quoted};
use std::borrow::Cow;

/// Most pages: an index has 16 bits.
const PAGES_MAX: usize = 1 << 16;

/// What deflate makes of a byte at most; PNG and our EXR use it.
const EXPANSION_MAX: u64 = 1040;

/// Reads maps and texels into an asset that has its splats.
///
/// # Errors
/// [`Error::Invalid`], [`Error::TooLarge`], and those of sidecar files.
pub fn read_maps(loaded: &Loaded<'_>, extension: &TextureExtension, asset: &mut SplatAsset) -> Result<()> {
    let Some((maps, placements)) = maps(loaded, extension, asset.num_splats())? else {
        return Ok(());
    };
    let atlas = Atlas { placements, pages: page_sizes(loaded, extension)?, border: 0 };
    atlas.check(&maps).map_err(|e| e.at(loaded.path))?;
    asset.texels = texels(loaded, extension, &atlas, &maps)?;
    asset.maps = maps;
    Ok(())
}

/// The maps and where they lie, not checked against the pages yet; `None` if there are none.
///
/// # Errors
/// [`Error::Invalid`], [`Error::TooLarge`].
pub fn maps(
    loaded: &Loaded<'_>,
    extension: &TextureExtension,
    num_splats: usize,
) -> Result<Option<(Vec<AssetMap>, Vec<Placement>)>> {
    let offence = |what: String| invalid!(loaded.path, "{}: {what}", super::EXTENSION);
    let (rects, sizes) = match (extension.rects, extension.texel_size) {
        (None, None) if extension.shift.is_none() => return Ok(None),
        (Some(rects), Some(sizes)) => (rects, sizes),
        _ => return Err(offence("\"rects\", \"texelSize\" and \"shift\" do not fit each other".to_owned())),
    };
    let own = |index: u32, what: &str, width: usize, components: &'static [Component]| {
        own_array(loaded, index, what, (width, components), num_splats)
    };
    let rects = own(rects, "rects", 4, &[Component::U16])?;
    let sizes = own(sizes, "texelSize", 2, &[Component::F32])?;
    let shifts = extension.shift.map(|s| own(s, "shift", 2, &[Component::I16])).transpose()?;
    let pages = extension.pages.map(|p| own(p, "pages", 1, &[Component::U8, Component::U16])).transpose()?;
    let mut shift_of = shifts.iter().flat_map(|s| s.rows::<2>());
    let mut page_of = pages.iter().flat_map(|p| p.rows::<1>());
    let mut maps = with_room(num_splats).map_err(|e| e.at(loaded.path))?;
    let mut placements = with_room(num_splats).map_err(|e| e.at(loaded.path))?;
    let mut next = 0_u64;
    for ([x, y, cols, rows], texel_sizes) in rects.rows::<4>().zip(sizes.rows::<2>()) {
        let offset_texels =
            u32::try_from(next).map_err(|_| too_large!(loaded.path, "more than {} texels", u32::MAX))?;
        // Whole numbers below 2^16: exact.
        let shift = shift_of.next().unwrap_or_default().map(|s| s as i16);
        let map = AssetMap { offset_texels, rows: rows as u16, cols: cols as u16, texel_sizes, shift };
        next += map.num_texels() as u64;
        let page = page_of.next().map_or(0, |[p]| p as u16);
        placements.push(Placement { page, x: x as u16, y: y as u16 });
        maps.push(map);
    }
    Ok(Some((maps, placements)))
}

/// An array of our extension: as many elements as splats, each of `width` numbers of one of the types.
///
/// # Errors
/// [`Error::Invalid`] naming it.
pub fn own_array<'a>(
    loaded: &'a Loaded<'_>,
    index: u32,
    name: &str,
    (width, components): (usize, &[Component]),
    num_splats: usize,
) -> Result<View<'a>> {
    let view = loaded.accessor(index, name)?;
    let fits = view.width == width && components.contains(&view.component) && !view.normalised;
    if fits && view.count == num_splats {
        return Ok(view);
    }
    let what = format!(
        "{}: {name}: {} elements of {} {:?}, expected {num_splats} of {width}, each one of {components:?}",
        super::EXTENSION,
        view.count,
        view.width,
        view.component
    );
    Err(Error::invalid(loaded.path, what))
}

/// `[width, height]` of the pages.
///
/// # Errors
/// [`Error::TooLarge`].
pub fn page_sizes(loaded: &Loaded<'_>, extension: &TextureExtension) -> Result<Vec<[u16; 2]>> {
    let count = extension.atlas.len();
    if count > PAGES_MAX {
        return Err(too_large!(loaded.path, "{count} atlas pages, at most {PAGES_MAX}"));
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

/// Texels of maps on an atlas that passed [`Atlas::check`]. Pages that no map lies on are not read. `[num_texels, 3]`
///
/// # Errors
/// [`Error::Invalid`] naming the page, [`Error::TooLarge`], and those of sidecar files.
pub fn texels(
    loaded: &Loaded<'_>,
    extension: &TextureExtension,
    atlas: &Atlas,
    maps: &[AssetMap],
) -> Result<Vec<f32>> {
    let at = |e: Error| e.at(loaded.path);
    let num_texels: usize = maps.iter().map(AssetMap::num_texels).sum();
    loaded.take_bytes(12 * num_texels as u64 + MapRows::num_bytes(maps), "texels")?;
    let rows = MapRows::new(atlas, maps).map_err(at)?;
    let mut texels = filled(3 * num_texels, 0.0).map_err(at)?;
    for (i, page) in extension.atlas.iter().enumerate().filter(|(i, _)| !rows.on_page(*i).is_empty()) {
        let name = match file_of(loaded, page) {
            Some(uri) => format!("atlas page {i} (file {})", quoted(uri)),
            None => format!("atlas page {i}"),
        };
        copy_page(loaded, page, extension, rows.on_page(i), atlas.pages[i], &mut texels)
            .map_err(|e| e.within(&name))?;
    }
    Ok(texels)
}

fn copy_page(
    loaded: &Loaded<'_>,
    page: &Page,
    extension: &TextureExtension,
    rows: PageRows<'_>,
    size: [u16; 2],
    texels: &mut [f32],
) -> Result<()> {
    let offence = |text: &str| Error::invalid(loaded.path, text);
    let [width, height] = size.map(u64::from);
    let check_size = |stored: usize, unpacked: u64| {
        if unpacked > EXPANSION_MAX * stored as u64 + 4096 {
            return Err(offence(&format!("{stored} bytes cannot hold {width} x {height} texels")));
        }
        Ok(())
    };
    match (page.buffer_view, page.texture, &page.uri) {
        (Some(view), None, None) => {
            let (_, bytes) = loaded.view(view, "texels")?;
            let expected = 12 * width * height;
            if bytes.len() as u64 != expected {
                return Err(offence(&format!("{} bytes, expected {expected} of f32 RGB", bytes.len())));
            }
            rows.copy_raw(bytes, size[0], texels);
            Ok(())
        }
        (None, None, Some(uri)) => {
            let bytes = loaded.side_file(uri)?;
            check_size(bytes.len(), 12 * width * height)?;
            rows.copy_exr(&bytes, size, texels, loaded.path)
        }
        (None, Some(texture), None) => {
            let decode = extension.decode.ok_or_else(|| offence("8 bits without \"decode\""))?;
            let decode = TexelDecode { scale: decode.scale, bias: decode.bias };
            if !(decode.scale.is_finite() && decode.scale > 0.0 && decode.bias.is_finite()) {
                return Err(offence(&format!("{decode:?}, expected finite numbers and a positive scale")));
            }
            let bytes = image_bytes(loaded, texture)?;
            check_size(bytes.len(), 3 * width * height)?;
            rows.copy_png(&bytes, size, &decode.table(), texels, loaded.path)
        }
        _ => Err(offence("expected exactly one of \"bufferView\", \"texture\" and \"uri\"")),
    }
}

/// The PNG of a core texture.
fn image_bytes<'a>(loaded: &'a Loaded<'_>, texture: u32) -> Result<Cow<'a, [u8]>> {
    let document = &loaded.document;
    let source = document.textures.get(texture as usize).and_then(|t| t.source);
    let image = source.and_then(|s| document.images.get(s as usize));
    let image = image.ok_or_else(|| invalid!(loaded.path, "texture {texture} without an image"))?;
    if let Some(kind) = image.mime_type.as_ref().filter(|m| m.as_str() != MIME_PNG) {
        let what = format!("an image of type {}; residuals must be kept as PNG", quoted(kind));
        return Err(Error::unsupported(loaded.path, what));
    }
    match (image.buffer_view, &image.uri) {
        (Some(view), None) => Ok(Cow::Borrowed(loaded.view(view, "image")?.1)),
        (None, Some(uri)) => loaded.side_file(uri).map(Cow::Owned),
        _ => Err(Error::invalid(loaded.path, "an image with neither or both of bufferView and uri")),
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

/// URI of a page that is a sidecar file.
fn file_of<'a>(loaded: &'a Loaded<'_>, page: &'a Page) -> Option<&'a str> {
    page.uri.as_deref().or_else(|| image_of(loaded, page)?.uri.as_deref())
}
