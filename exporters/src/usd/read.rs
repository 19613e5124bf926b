//! Reads the asset of a stage that this crate wrote.

use super::binary::{self, BinaryLayer, layer_from_binary};
use super::field::Field;
use super::files::Container;
use super::layer::{Layer, Prim, entry, for_each_prim};
use super::names::*;
use super::package::{Entry, entries_from_package, is_plain_path};
use super::sections;
use super::text_read::{TextLayer, layer_from_text};
use super::value::Value;
use crate::atlas::{self, Atlas};
use crate::file::read_file;
use crate::meta::{META_BYTES_MAX, Meta};
use crate::{Contents, Error, Quality, ReadLimits, Result, SplatAsset, yup};
use std::borrow::Cow;
use std::path::Path;

/// Decompression makes at most so many bytes of one; an image that claims more is refused before it is decoded.
const IMAGE_EXPANSION_MAX: u64 = 1100;

/// Reads a `.usda`, `.usdc` or `.usdz` file that this crate wrote, also after other programs stored its layer anew.
/// Pages are looked for beside the file and below only; they count in the sections. A hash that differs is a warning.
///
/// # Errors
/// [`Error::Invalid`] for damaged files, [`Error::Unsupported`] naming the feature for those of other programs,
/// [`Error::TooLarge`], [`Error::Io`].
pub fn read_usd(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    Opened::open(path, limits)?.contents(limits)
}

/// A file's layer and where its images are.
pub(super) struct Opened<'a> {
    path: &'a Path,
    pub(super) layer: Layer,
    /// Length of the layer's file or entry.
    layer_bytes: u64,
    /// Bytes of a binary layer's tables; `None`: a text.
    table_bytes: Option<u64>,
    /// Path of a property and bytes of its value or its text.
    value_bytes: Vec<(String, u64)>,
    /// Of a package.
    entries: Option<Vec<Entry>>,
    file_bytes: u64,
}

impl<'a> Opened<'a> {
    pub(super) fn open(path: &'a Path, limits: &ReadLimits) -> Result<Self> {
        let container = Container::of(path)?;
        let bytes = read_file(path, limits.decoded_bytes)?;
        let limits = &limits.of_file(bytes.len() as u64);
        if container != Container::Package {
            return Self::layer(path, &bytes, limits);
        }
        let mut entries = entries_from_package(&bytes, path, limits)?;
        if entries.is_empty() {
            return Err(Error::invalid(path, "a package without entries"));
        }
        let root = entries.remove(0);
        let mut opened = Self::layer(path, &root.bytes, limits)?;
        (opened.entries, opened.file_bytes) = (Some(entries), bytes.len() as u64);
        Ok(opened)
    }

    /// A layer, text or binary as its first bytes say.
    fn layer(path: &'a Path, bytes: &[u8], limits: &ReadLimits) -> Result<Self> {
        let file_bytes = bytes.len() as u64;
        let (layer, table_bytes, value_bytes) = if bytes.starts_with(binary::MAGIC) {
            let BinaryLayer { layer, table_bytes, value_bytes } = layer_from_binary(bytes, path, limits)?;
            (layer, Some(table_bytes), value_bytes)
        } else {
            let text = std::str::from_utf8(bytes).map_err(|e| Error::invalid(path, format!("text: {e}")))?;
            let TextLayer { layer, value_bytes } = layer_from_text(text, path, limits.decoded_bytes)?;
            (layer, None, value_bytes)
        };
        Ok(Self { path, layer, layer_bytes: file_bytes, table_bytes, value_bytes, entries: None, file_bytes })
    }

    /// Every prim with its path without variants.
    pub(super) fn prims(&self) -> Vec<(String, &Prim)> {
        let mut prims = Vec::new();
        for_each_prim(&self.layer, &mut |path, prim| prims.push((without_variants(path), prim)));
        prims
    }

    /// Our dictionary.
    pub(super) fn facts(&self) -> Option<&[(String, Value)]> {
        let custom = entry(&self.layer.metadata, "customLayerData");
        let Some(Value::Dictionary(custom)) = custom else { return None };
        match entry(custom, LITETEX) {
            Some(Value::Dictionary(facts)) => Some(facts),
            _ => None,
        }
    }

    fn fact(&self, name: &str) -> Option<&str> {
        entry(self.facts()?, name)?.as_text()
    }

    /// Frame, cameras and provenance, if the file is ours.
    pub(super) fn meta(&self) -> Result<Option<Meta>> {
        let Some(meta) = self.fact("meta") else { return Ok(None) };
        if meta.len() > META_BYTES_MAX {
            return Err(Error::too_large(self.path, format!("meta of {} bytes", meta.len())));
        }
        let meta = serde_json::from_str(meta);
        meta.map(Some).map_err(|e| Error::invalid(self.path, format!("litetex:meta: {e}")))
    }

    /// Step of the codes of texels; 0: they are floats.
    pub(super) fn texel_step(&self) -> f64 {
        let prims = self.prims();
        let scale = prims.iter().find_map(|(_, p)| p.value(DECODE_SCALE)?.as_double());
        scale.map_or(0.0, f64::abs)
    }

    /// Bytes of an image to which the layer refers, at most `bytes_max`.
    ///
    /// # Errors
    /// Name the image and the layer.
    pub(super) fn image(&self, asset_path: &str, bytes_max: u64) -> Result<Cow<'_, [u8]>> {
        let invalid = |what: &str| Error::invalid(self.path, format!("page @{asset_path}@: {what}"));
        let plain = asset_path.strip_prefix("./").unwrap_or(asset_path);
        // Programs that flatten stages make paths absolute; they may do so as long as they stay in the folder.
        let is_absolute = self.entries.is_none() && plain.strip_prefix('/').is_some_and(is_plain_path);
        if !is_plain_path(plain) && !is_absolute {
            return Err(invalid("pages lie beside or below the file, their paths are relative to it"));
        }
        if let Some(entries) = &self.entries {
            let entry = entries.iter().find(|e| e.name == plain);
            return entry
                .map(|e| Cow::Borrowed(e.bytes.as_slice()))
                .ok_or_else(|| invalid("not in the package"));
        }
        let place = self.path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let file = place.join(plain);
        let io = |e| Error::io(&file, e).named_by(self.path);
        let (place, real) = (place.canonicalize().map_err(io)?, file.canonicalize().map_err(io)?);
        if !real.starts_with(&place) {
            return Err(invalid("it lies outside of the file's folder"));
        }
        let bytes = read_file(&real, bytes_max).map_err(|e| e.at(&file).named_by(self.path))?;
        Ok(Cow::Owned(bytes))
    }

    fn contents(&self, limits: &ReadLimits) -> Result<Contents> {
        let mut asset = SplatAsset::default();
        let meta = self.meta()?.ok_or_else(|| {
            let what = "no customLayerData:litetex:meta: not a file of this program; other USD files are not supported";
            Error::unsupported(self.path, what)
        })?;
        meta.store(&mut asset);
        let prims = self.prims();
        let field =
            prims.iter().find(|(_, p)| p.type_name == FIELD_TYPE && p.property(LITETEX_VERSION).is_some());
        let (_, field) = field.ok_or_else(|| {
            Error::unsupported(
                self.path,
                format!("no {FIELD_TYPE} with {LITETEX_VERSION}: no textured splats"),
            )
        })?;
        Field { path: self.path, prim: field }.store(&mut asset, &limits.of_file(self.file_bytes))?;
        let texture_bytes = self.texels(field, &prims, &mut asset, limits)?;
        asset.validate().map_err(|e| e.at(self.path))?;
        let hash = self.fact("hash").and_then(|h| u64::from_str_radix(h, 16).ok());
        let mut warnings = Vec::new();
        match hash {
            Some(hash) if hash == asset.hash() => {}
            Some(hash) => warnings.push(format!(
                "the hash is {:016x}, the file says {hash:016x}: numbers were changed after it was written",
                asset.hash()
            )),
            None => warnings.push("the file has no hash".to_owned()),
        }
        self.check_node(&prims, &asset, &mut warnings);
        Ok(Contents {
            asset,
            format: self.format().to_owned(),
            quality: self.fact("quality").and_then(Quality::from_name),
            hash,
            sections: self.sections(texture_bytes),
            warnings,
        })
    }

    /// The transformation is told by the metadata; a stage that was moved since is worth a word.
    fn check_node(&self, prims: &[(String, &Prim)], asset: &SplatAsset, warnings: &mut Vec<String>) {
        let node = yup::node(&asset.world_from_local());
        let expected = [node.translation.as_slice(), node.rotation.as_slice(), &[node.scale; 3]];
        let names = ["xformOp:translate", "xformOp:orient", "xformOp:scale"];
        let scene = prims.iter().find(|(path, _)| *path == format!("/{SCENE}"));
        let agrees = names.iter().zip(expected).all(|(name, expected)| {
            let value = scene.and_then(|(_, scene)| scene.value(name));
            matches!(value, Some(Value::Doubles(n)) if n.values.as_slice() == expected)
        });
        if !agrees {
            warnings
                .push(format!("the transformation of /{SCENE} is not that of the metadata, which is taken"));
        }
    }

    fn format(&self) -> &'static str {
        match (&self.entries, self.table_bytes) {
            (Some(_), Some(_)) => "OpenUSD package (usdz) with a binary layer",
            (Some(_), None) => "OpenUSD package (usdz) with a text layer",
            (None, Some(_)) => "OpenUSD binary (usdc)",
            (None, None) => "OpenUSD text 1.0 (usda)",
        }
    }

    fn sections(&self, texture_bytes: u64) -> Vec<crate::Section> {
        let images = self.entries.as_ref().map(|entries| {
            let of = |e: &Entry| (e.name.clone(), e.bytes.len() as u64);
            entries.iter().map(of).collect::<Vec<_>>()
        });
        let layer = sections::LayerBytes {
            all: self.layer_bytes,
            tables: self.table_bytes,
            values: &self.value_bytes,
        };
        sections::of(&layer, images.as_deref(), self.file_bytes, texture_bytes)
    }

    /// Pages that a material of a particle field names.
    fn page_paths(&self, field: &Prim, prims: &[(String, &Prim)]) -> Vec<String> {
        use super::layer::Content;
        let Some(Content::Relationship { targets }) = field.property(BINDING).map(|p| &p.content) else {
            return Vec::new();
        };
        let Some(target) = targets.first() else { return Vec::new() };
        let prefix = format!("{}/Page", without_variants(target));
        let file = |(path, prim): &(String, &Prim)| {
            let index: usize = path.strip_prefix(&prefix)?.parse().ok()?;
            match prim.value("inputs:file") {
                Some(Value::Asset(file)) => Some((index, file.clone())),
                _ => None,
            }
        };
        let mut pages: Vec<_> = prims.iter().filter_map(file).collect();
        pages.sort();
        pages.dedup_by_key(|p| p.0);
        pages.into_iter().map(|(_, file)| file).collect()
    }

    /// Reads the pages and collects the texels. Returns the bytes of pages beside the file.
    fn texels(
        &self,
        field: &Prim,
        prims: &[(String, &Prim)],
        asset: &mut SplatAsset,
        limits: &ReadLimits,
    ) -> Result<u64> {
        let reader = Field { path: self.path, prim: field };
        let sizes = reader.page_sizes()?;
        let paths = self.page_paths(field, prims);
        if sizes.len() != paths.len() {
            let what = format!("{} pages in {PAGE_SIZES}, but {} in the material", sizes.len(), paths.len());
            return Err(Error::invalid(self.path, what));
        }
        let atlas = Atlas { placements: reader.placements(asset.num_splats())?, pages: sizes };
        atlas.check(&asset.maps).map_err(|e| e.at(self.path))?;
        let num_texels: u64 = asset.maps.iter().map(|m| m.num_texels() as u64).sum();
        let paper: u64 = atlas.pages.iter().map(|p| u64::from(p[0]) * u64::from(p[1])).sum();
        if num_texels > paper {
            let what = format!("maps of {num_texels} texels on pages of {paper}: they overlap");
            return Err(Error::invalid(self.path, what));
        }
        let decode = reader.decode()?;
        let texel_bytes = if decode.is_some() { 3 } else { 12 };
        let mut files = Vec::new();
        let mut image_bytes = 0;
        for (path, size) in paths.iter().zip(&atlas.pages) {
            let bytes = self.image(path, limits.decoded_bytes.saturating_sub(image_bytes))?;
            if self.entries.is_none() {
                image_bytes += bytes.len() as u64;
            }
            let raw = u64::from(size[0]) * u64::from(size[1]) * texel_bytes;
            if raw > (bytes.len() as u64).saturating_mul(IMAGE_EXPANSION_MAX) {
                let what =
                    format!("page @{path}@: {} bytes for {} x {} texels", bytes.len(), size[0], size[1]);
                return Err(Error::invalid(self.path, what));
            }
            files.push(bytes);
        }
        // The pages, and the texels with their codes.
        let decoded = paper.saturating_mul(texel_bytes).saturating_add(num_texels.saturating_mul(15));
        limits.of_file(self.file_bytes + image_bytes).check(decoded, "pages", self.path)?;
        let on_pages = files.iter().zip(&atlas.pages);
        asset.texels = match decode {
            Some(decode) => {
                let pages: Vec<Vec<u8>> = on_pages
                    .zip(&paths)
                    .map(|((bytes, &size), name)| {
                        atlas::decode_png(bytes, size, self.path).map_err(|e| of_page(e, name))
                    })
                    .collect::<Result<_>>()?;
                let codes = atlas.texels_from_pages(&asset.maps, &pages);
                codes.into_iter().map(|code| decode.texel(code)).collect()
            }
            None => {
                let pages: Vec<Vec<f32>> = on_pages
                    .zip(&paths)
                    .map(|((bytes, &size), name)| {
                        atlas::decode_exr(bytes, size, self.path).map_err(|e| of_page(e, name))
                    })
                    .collect::<Result<_>>()?;
                atlas.texels_from_pages(&asset.maps, &pages)
            }
        };
        Ok(image_bytes)
    }
}

/// What is wrong with a page, with its name.
fn of_page(error: Error, name: &str) -> Error {
    match error {
        Error::Invalid { path, what } => Error::invalid(path, format!("page @{name}@: {what}")),
        Error::Unsupported { path, what } => Error::unsupported(path, format!("page @{name}@: {what}")),
        other => other,
    }
}

/// A path without `{set=variant}`.
pub(super) fn without_variants(path: &str) -> String {
    let mut out = String::new();
    let mut rest = path;
    while let Some((before, after)) = rest.split_once('{') {
        out.push_str(before);
        rest = after.split_once('}').map_or("", |(_, rest)| rest);
        out.push('/');
    }
    out + rest
}
