//! Writes assets as files: the layer, its images and the package.

use super::binary::binary_from_layer;
use super::cameras;
use super::layer::Layer;
use super::package::{Entry, package_from_entries};
use super::stage::{self, Images};
use super::text_write::text_from_layer;
use crate::atlas::{self, Atlas, PAGE_SIDE, PAGE_SIDE_MAX, TexelDecode};
use crate::fallback::quads::{self, QUADS_MAX, Quads};
use crate::fallback::shown_cameras::Cameras;
use crate::files::sidecars::SidecarHashes;
use crate::files::staging::{SidecarFile, Staged};
use crate::{Error, Quality, Result, SplatAsset};
use std::path::{Path, PathBuf};

/// Name of a package's root layer.
pub(super) const PACKAGE_ROOT: &str = "scene.usdc";

/// How to write a USD file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsdOptions {
    /// Lossless files have pages of 32-bit EXR, balanced ones of 8-bit PNG; everything else is exact in both.
    pub quality: Quality,
    /// Largest side of a page, texels; at most 8192.
    pub page_side: u16,
    /// Whether to write the variant `mesh`, a preview of at most 50,000 rectangles.
    pub mesh: bool,
    /// Cameras for other programs; the metadata hold all.
    pub cameras: Cameras,
}

impl Default for UsdOptions {
    fn default() -> Self {
        Self { quality: Quality::default(), page_side: PAGE_SIDE, mesh: true, cameras: Cameras::default() }
    }
}

/// Writes an asset as `.usda`, `.usdc` or `.usdz`, by the extension of `path`. Text and binary files have their images in
/// the folder `STEM_usda_textures` or `STEM_usdc_textures` next to them; a package holds them. Returns all files, the one at
/// `path` first.
///
/// # Errors
/// [`Error::Unsupported`] for other extensions and for qualities other than lossless and balanced, [`Error::Invalid`] and
/// [`Error::TooLarge`] for assets that break a rule or do not fit, [`Error::Io`].
pub fn write_usd(path: &Path, asset: &SplatAsset, options: &UsdOptions) -> Result<Vec<PathBuf>> {
    let (root, side) = encode_files(path, asset, options)?;
    Ok(Staged::new(path, root, side)?.publish(true)?.files)
}

/// Encodes the file at `path` and the images next to it.
///
/// # Errors
/// As [`write_usd`], without [`Error::Io`].
pub(crate) fn encode_files(
    path: &Path,
    asset: &SplatAsset,
    options: &UsdOptions,
) -> Result<(Vec<u8>, Vec<SidecarFile>)> {
    let container = Container::of(path)?;
    let folder = match container {
        Container::Package => "textures".to_owned(),
        Container::Text => textures_name(stem(path)?, "usda"),
        Container::Binary => textures_name(stem(path)?, "usdc"),
    };
    let is_package = container == Container::Package;
    let Bundle { layer, images } = Bundle::of(asset, options, &folder, is_package).map_err(|e| e.at(path))?;
    let root = match container {
        Container::Text => text_from_layer(&layer).into_bytes(),
        Container::Binary | Container::Package => binary_from_layer(&layer),
    };
    drop(layer);
    if is_package {
        let root = Entry { name: PACKAGE_ROOT.to_owned(), bytes: root };
        let entries = std::iter::once(root).chain(images).collect();
        return Ok((package_from_entries(entries).map_err(|e| e.at(path))?, Vec::new()));
    }
    Ok((root, images.into_iter().map(|p| (p.name.into(), p.bytes)).collect()))
}

/// Name of the folder with a layer's images; text and binary files of one stem do not share it.
pub(crate) fn textures_name(stem: &str, extension: &str) -> String {
    format!("{stem}_{extension}_textures")
}

/// The three kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Container {
    Text,
    Binary,
    Package,
}

impl Container {
    /// The container that the extension of a file names.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match extension.as_str() {
            "usda" => Ok(Self::Text),
            "usdc" => Ok(Self::Binary),
            "usdz" => Ok(Self::Package),
            other => Err(unsupported!(path, "extension {other:?}; supported: usda, usdc, usdz")),
        }
    }
}

/// The file's name without extension, which asset paths contain.
pub(crate) fn stem(path: &Path) -> Result<&str> {
    let stem = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    if stem.is_empty() || stem.contains(|c: char| c.is_control() || matches!(c, '@' | ':' | '\\')) {
        let what = "the file's name must be UTF-8 without \"@\", \":\", \"\\\" and control characters: USD files hold it";
        return Err(Error::invalid(path, what));
    }
    Ok(stem)
}

/// A stage and its images, with names relative to the layer.
struct Bundle {
    layer: Layer,
    images: Vec<Entry>,
}

impl Bundle {
    /// `is_package`: whether the images are in the same file as the layer.
    fn of(asset: &SplatAsset, options: &UsdOptions, folder: &str, is_package: bool) -> Result<Self> {
        asset.validate()?;
        if options.page_side == 0 || options.page_side > PAGE_SIDE_MAX {
            let what = format!("pages of {} texels per side, at most {PAGE_SIDE_MAX}", options.page_side);
            return Err(Error::too_large("", what));
        }
        let atlas = Atlas::of(asset, options.page_side)?;
        let (pages, decode, hash) = match options.quality {
            Quality::Lossless => (exr_pages(asset, &atlas)?, None, asset.hash()),
            Quality::Balanced => {
                let decode = TexelDecode::finest(&asset.texels);
                let codes: Vec<u8> = asset.texels.iter().map(|&t| decode.code(t)).collect();
                let decoded = codes.iter().map(|&c| decode.texel(c)).collect();
                // Of the asset that a reader gets.
                let hash = SplatAsset { texels: decoded, ..asset.clone() }.hash();
                (png_pages(asset, &atlas, &codes)?, Some(decode), hash)
            }
            Quality::Tiny | Quality::Custom => {
                let what = "USD has the qualities lossless and balanced; .ltgs and glTF have the others";
                return Err(Error::unsupported("", what));
            }
        };
        let extension = if decode.is_none() { "exr" } else { "png" };
        let mut images = named(pages, folder, "page", extension);
        let page_paths: Vec<_> = images.iter().map(asset_path).collect();
        let quads =
            options.mesh.then(|| Quads::of(asset, QUADS_MAX, options.page_side.max(64))).transpose()?;
        let mut quad_pages = Vec::new();
        for page in quads.iter().flat_map(|q| &q.pages) {
            quad_pages.push(quads::encode_page(page)?);
        }
        let quad_images = named(quad_pages, folder, "quads", "png");
        let quad_paths: Vec<_> = quad_images.iter().map(asset_path).collect();
        images.extend(quad_images);
        let mut sidecars = SidecarHashes::default();
        for image in images.iter().filter(|_| !is_package) {
            sidecars.add(&asset_path(image), &image.bytes);
        }
        let stage_images = Images {
            atlas: &atlas,
            page_paths: &page_paths,
            decode,
            quads: quads.as_ref(),
            quad_paths: &quad_paths,
            sidecars,
        };
        let mut layer = stage::layer(asset, options.quality, hash, &stage_images)?;
        layer.root_prims.extend(cameras::prim(asset, options.cameras));
        Ok(Self { layer, images })
    }
}

fn exr_pages(asset: &SplatAsset, atlas: &Atlas) -> Result<Vec<Vec<u8>>> {
    let pages = atlas.pages_from_texels(&asset.maps, &asset.texels, 0.0);
    pages.iter().zip(&atlas.pages).map(|(page, &size)| atlas::encode_exr(size, page)).collect()
}

fn png_pages(asset: &SplatAsset, atlas: &Atlas, codes: &[u8]) -> Result<Vec<Vec<u8>>> {
    let pages = atlas.pages_from_texels(&asset.maps, codes, 0);
    pages.iter().zip(&atlas.pages).map(|(page, &size)| atlas::encode_png(size, page)).collect()
}

fn named(images: Vec<Vec<u8>>, folder: &str, name: &str, extension: &str) -> Vec<Entry> {
    let named = |(i, bytes)| Entry { name: format!("{folder}/{name}{i}.{extension}"), bytes };
    images.into_iter().enumerate().map(named).collect()
}

/// Asset path of an image, relative to the layer.
fn asset_path(image: &Entry) -> String {
    format!("./{}", image.name)
}
