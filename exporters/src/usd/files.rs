//! Writes assets as files: which file holds what, and what is removed if one fails.

use super::binary::binary_from_layer;
use super::layer::Layer;
use super::package::{Entry, package_from_entries};
use super::stage::{self, Pictures};
use super::text_write::text_from_layer;
use crate::atlas::{self, Atlas, PAGE_SIDE, PAGE_SIDE_MAX, TexelDecode};
use crate::quads::{self, QUADS_MAX, Quads};
use crate::{Error, Quality, Result, SplatAsset, write_atomically};
use std::path::{Path, PathBuf};

/// Root layer of a package.
pub(super) const PACKAGE_ROOT: &str = "scene.usdc";

/// What to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsdOptions {
    /// Lossless: pages are EXR of 32 bits. Balanced: PNG of 8 bits; all else is exact in both.
    pub quality: Quality,
    /// Largest side of a page, texels; at most 8192.
    pub page_side: u16,
    /// Whether the variant `mesh` is written: a preview of at most 50,000 rectangles.
    pub mesh: bool,
}

impl Default for UsdOptions {
    fn default() -> Self {
        Self { quality: Quality::default(), page_side: PAGE_SIDE, mesh: true }
    }
}

/// Writes an asset as `.usda`, `.usdc` or `.usdz`, by the path's extension. Text and binary files have their pictures
/// beside them, in the folder `STEM_textures`; a package holds them. Returns the files, the one at `path` first.
/// If one cannot be written, those of this call are removed.
///
/// # Errors
/// [`Error::Unsupported`] for other extensions and [`Quality::Tiny`], [`Error::Invalid`] and [`Error::TooLarge`] for
/// assets that break a rule or do not fit, [`Error::Io`].
pub fn write_usd(path: &Path, asset: &SplatAsset, options: &UsdOptions) -> Result<Vec<PathBuf>> {
    let container = Container::of(path)?;
    let folder = match container {
        Container::Package => "textures".to_owned(),
        Container::Text | Container::Binary => format!("{}_textures", stem(path)?),
    };
    let bundle = Bundle::of(asset, options, &folder).map_err(|e| e.at(path))?;
    let root = match container {
        Container::Text => text_from_layer(&bundle.layer).into_bytes(),
        Container::Binary => binary_from_layer(&bundle.layer),
        Container::Package => {
            let root = Entry { name: PACKAGE_ROOT.to_owned(), bytes: binary_from_layer(&bundle.layer) };
            let entries: Vec<Entry> = std::iter::once(root).chain(bundle.pictures).collect();
            let bytes = package_from_entries(&entries).map_err(|e| e.at(path))?;
            return write_all(path, &folder, bytes, Vec::new());
        }
    };
    write_all(path, &folder, root, bundle.pictures)
}

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Container {
    Text,
    Binary,
    Package,
}

impl Container {
    /// By extension.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match extension.as_str() {
            "usda" => Ok(Self::Text),
            "usdc" => Ok(Self::Binary),
            "usdz" => Ok(Self::Package),
            other => {
                let what = format!("extension {other:?}; supported: usda, usdc, usdz");
                Err(Error::unsupported(path, what))
            }
        }
    }
}

/// Name without extension, as it may stand in a file.
fn stem(path: &Path) -> Result<&str> {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    if stem.is_empty() || stem.contains(|c: char| c.is_control() || matches!(c, '@' | ':' | '\\')) {
        let what = "the file's name must be UTF-8 without \"@\", \":\", \"\\\" and control characters: USD files hold it";
        return Err(Error::invalid(path, what));
    }
    Ok(stem)
}

/// A stage and its pictures; names are relative to the layer.
struct Bundle {
    layer: Layer,
    pictures: Vec<Entry>,
}

impl Bundle {
    fn of(asset: &SplatAsset, options: &UsdOptions, folder: &str) -> Result<Self> {
        asset.validate()?;
        if options.page_side == 0 || options.page_side > PAGE_SIDE_MAX {
            let what = format!("pages of {} texels a side, at most {PAGE_SIDE_MAX}", options.page_side);
            return Err(Error::too_large("", what));
        }
        let atlas = Atlas::of(asset, options.page_side)?;
        let (pages, decode, hash) = match options.quality {
            Quality::Lossless => (exr_pages(asset, &atlas)?, None, asset.hash()),
            Quality::Balanced => {
                let decode = TexelDecode::finest(&asset.texels);
                let codes: Vec<u8> = asset.texels.iter().map(|&t| decode.code(t)).collect();
                let decoded = codes.iter().map(|&c| decode.texel(c)).collect();
                // What a reader gets.
                let hash = SplatAsset { texels: decoded, ..asset.clone() }.hash();
                (png_pages(asset, &atlas, &codes)?, Some(decode), hash)
            }
            Quality::Tiny | Quality::Custom => {
                let what = "quality \"tiny\" in USD; supported: lossless, balanced";
                return Err(Error::unsupported("", what));
            }
        };
        let extension = if decode.is_none() { "exr" } else { "png" };
        let mut pictures = named(pages, folder, "page", extension);
        let page_paths = asset_paths(&pictures);
        let quads =
            options.mesh.then(|| Quads::of(asset, QUADS_MAX, options.page_side.max(64))).transpose()?;
        let mut quad_pages = Vec::new();
        for page in quads.iter().flat_map(|q| &q.pages) {
            quad_pages.push(quads::encode_page(page)?);
        }
        let quad_pictures = named(quad_pages, folder, "quads", "png");
        let quad_paths = asset_paths(&quad_pictures);
        pictures.extend(quad_pictures);
        let stage_pictures = Pictures {
            atlas: &atlas,
            page_paths: &page_paths,
            decode,
            quads: quads.as_ref(),
            quad_paths: &quad_paths,
        };
        let layer = stage::layer(asset, options.quality, hash, &stage_pictures)?;
        Ok(Self { layer, pictures })
    }
}

fn exr_pages(asset: &SplatAsset, atlas: &Atlas) -> Result<Vec<Vec<u8>>> {
    let pages = atlas.pages_from_texels(&asset.maps, &asset.texels);
    pages.iter().zip(&atlas.pages).map(|(page, &size)| atlas::encode_exr(size, page)).collect()
}

fn png_pages(asset: &SplatAsset, atlas: &Atlas, codes: &[u8]) -> Result<Vec<Vec<u8>>> {
    let pages = atlas.pages_from_texels(&asset.maps, codes);
    pages.iter().zip(&atlas.pages).map(|(page, &size)| atlas::encode_png(size, page)).collect()
}

fn named(pictures: Vec<Vec<u8>>, folder: &str, name: &str, extension: &str) -> Vec<Entry> {
    let named = |(i, bytes)| Entry { name: format!("{folder}/{name}{i}.{extension}"), bytes };
    pictures.into_iter().enumerate().map(named).collect()
}

/// How a layer refers to pictures: from its own place.
fn asset_paths(pictures: &[Entry]) -> Vec<String> {
    pictures.iter().map(|p| format!("./{}", p.name)).collect()
}

/// Writes pictures and then the root, or nothing.
fn write_all(path: &Path, folder: &str, root: Vec<u8>, pictures: Vec<Entry>) -> Result<Vec<PathBuf>> {
    let place = path.parent().unwrap_or(Path::new(""));
    let folder = place.join(folder);
    let makes_folder = !pictures.is_empty() && !folder.exists();
    if makes_folder {
        std::fs::create_dir(&folder).map_err(|e| Error::io(&folder, e))?;
    }
    let mut written = vec![path.to_owned()];
    let mut write = |path: PathBuf, bytes: &[u8]| {
        write_atomically(&path, bytes).map_err(|e| Error::io(&path, e)).map(|()| written.push(path))
    };
    let result = pictures
        .iter()
        .try_for_each(|picture| write(place.join(&picture.name), &picture.bytes))
        .and_then(|()| write(path.to_owned(), &root));
    match result {
        Ok(()) => {
            written.pop();
            Ok(written)
        }
        Err(error) => {
            // The first error is the one that matters. The file at `path` was not written.
            for file in &written[1..] {
                let _ = std::fs::remove_file(file);
            }
            if makes_folder {
                let _ = std::fs::remove_dir(&folder);
            }
            Err(error)
        }
    }
}
