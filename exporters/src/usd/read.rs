//! Reads the asset of a stage that this crate wrote.

use super::binary::{BinaryLayer, layer_from_binary};
use super::field::Field;
use super::files::Container;
use super::layer::{Content, Layer, Prim, entry, for_each_prim};
use super::names::*;
use super::package::{Entry, entries_from_package, is_plain_path};
use super::sections;
use super::text_read::{TextLayer, layer_from_text};
use super::value::Value;
use crate::asset::hash::{hash_from_text, text_from_hash};
use crate::asset::meta::{META_BYTES_MAX, Meta};
use crate::atlas::MapRows;
use crate::files::limits::filled;
use crate::files::read::read_file;
use crate::files::sidecars::SidecarHashes;
use crate::math::yup;
use crate::{Contents, Error, Quality, ReadLimits, Result, SplatAsset, quoted};
use serde::de::DeserializeOwned;
use std::borrow::Cow;
use std::path::Path;

/// Bytes that decompression makes of one at most; images that claim more are refused before they are decoded.
const IMAGE_EXPANSION_MAX: u64 = 1100;

/// Reads a `.usda`, `.usdc` or `.usdz` file that this crate wrote. Pages are looked for next to the file and below only;
/// they count in the sections. A hash that differs is a warning.
///
/// # Errors
/// [`Error::Invalid`] for damaged files, [`Error::Unsupported`] naming the feature for those of other programs,
/// [`Error::TooLarge`], [`Error::Io`].
pub fn read_usd(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    Opened::open(path, limits)?.contents(limits)
}

/// The layer of a file, and where its images are.
pub(super) struct Opened<'a> {
    path: &'a Path,
    pub(super) layer: Layer,
    /// Length of the layer.
    layer_bytes: u64,
    /// Bytes of the tables of a binary layer; `None` for text.
    table_bytes: Option<u64>,
    /// Path of a property, and bytes of its value or its text.
    value_bytes: Vec<(String, u64)>,
    /// The entries of a package but the layer.
    entries: Option<Vec<Entry>>,
    file_bytes: u64,
    hashes: SidecarHashes,
}

impl<'a> Opened<'a> {
    pub(super) fn open(path: &'a Path, limits: &ReadLimits) -> Result<Self> {
        let container = Container::of(path)?;
        let bytes = read_file(path, limits.decoded_bytes)?;
        let limits = &limits.of_file(bytes.len() as u64);
        let (entries, root) = match container {
            Container::Package => {
                let mut entries = entries_from_package(&bytes, path, limits)?;
                if entries.is_empty() {
                    return Err(Error::invalid(path, "a package without entries"));
                }
                let root = entries.remove(0);
                (Some(entries), Cow::Owned(root.bytes))
            }
            Container::Text | Container::Binary => (None, Cow::Borrowed(bytes.as_slice())),
        };
        let (layer, table_bytes, value_bytes) = if container == Container::Text {
            let text = std::str::from_utf8(&root).map_err(|e| invalid!(path, "text: {e}"))?;
            let TextLayer { layer, value_bytes } = layer_from_text(text, path, limits.decoded_bytes)?;
            (layer, None, value_bytes)
        } else {
            let BinaryLayer { layer, table_bytes, value_bytes } = layer_from_binary(&root, path, limits)?;
            (layer, Some(table_bytes), value_bytes)
        };
        let (layer_bytes, file_bytes) = (root.len() as u64, bytes.len() as u64);
        let hashes = SidecarHashes::default();
        let mut opened =
            Self { path, layer, layer_bytes, table_bytes, value_bytes, entries, file_bytes, hashes };
        opened.hashes = opened.json(SIDECARS)?.unwrap_or_default();
        Ok(opened)
    }

    /// All prims with their paths, in which variants are left out.
    pub(super) fn prims(&self) -> Vec<(String, &Prim)> {
        let mut prims = Vec::new();
        for_each_prim(&self.layer, &mut |path, prim| prims.push((without_variants(path), prim)));
        prims
    }

    /// Our dictionary in the layer's custom data.
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

    /// Frame, cameras and provenance; `None` if the file is not ours.
    pub(super) fn meta(&self) -> Result<Option<Meta>> {
        self.json("meta")
    }

    /// An entry of our dictionary that is a JSON object.
    fn json<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>> {
        let Some(text) = self.fact(name) else { return Ok(None) };
        if text.len() > META_BYTES_MAX {
            return Err(too_large!(self.path, "{name} of {} bytes", text.len()));
        }
        let value = serde_json::from_str(text);
        value.map(Some).map_err(|e| invalid!(self.path, "litetex:{name}: {e}"))
    }

    /// Step between codes of texels; 0 for floats.
    pub(super) fn texel_step(&self) -> f64 {
        let prims = self.prims();
        let scale = prims.iter().find_map(|(_, p)| p.value(DECODE_SCALE)?.as_double());
        scale.map_or(0.0, f64::abs)
    }

    /// Bytes of an image to which the layer refers, at most `bytes_max`.
    ///
    /// # Errors
    /// [`Error::Invalid`], [`Error::TooLarge`] and [`Error::Io`], naming the image.
    pub(super) fn image(&self, asset_path: &str, bytes_max: u64) -> Result<Cow<'_, [u8]>> {
        let invalid = |what: &str| invalid!(self.path, "{}: {what}", page_named(asset_path));
        let plain = asset_path.strip_prefix("./").unwrap_or(asset_path);
        if !is_plain_path(plain) {
            return Err(invalid(
                "pages must be in the folder of the file or below, with paths relative to it",
            ));
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
            return Err(invalid("it is outside the folder of the file"));
        }
        let bytes = read_file(&real, bytes_max).map_err(|e| e.at(&file).named_by(self.path))?;
        self.hashes.check(asset_path, &bytes, self.path)?;
        Ok(Cow::Owned(bytes))
    }

    pub(super) fn contents(&self, limits: &ReadLimits) -> Result<Contents> {
        let mut asset = SplatAsset::default();
        let meta = self.meta()?.ok_or_else(|| {
            let what = "no customLayerData:litetex:meta: not written by this program; other USD files are not supported";
            Error::unsupported(self.path, what)
        })?;
        meta.store(&mut asset);
        let prims = self.prims();
        let field =
            prims.iter().find(|(_, p)| p.type_name == FIELD_TYPE && p.property(LITETEX_VERSION).is_some());
        let (_, field) = field.ok_or_else(|| {
            unsupported!(self.path, "no {FIELD_TYPE} with {LITETEX_VERSION}: no textured splats")
        })?;
        Field { path: self.path, prim: field }.store(&mut asset, &limits.of_file(self.file_bytes))?;
        let texture_bytes = self.texels(field, &prims, &mut asset, limits)?;
        asset.validate().map_err(|e| e.at(self.path))?;
        let hash = self.fact("hash").and_then(hash_from_text);
        let mut warnings = Vec::new();
        match hash {
            Some(hash) if hash == asset.hash() => {}
            Some(hash) => warnings.push(format!(
                "the hash is {}, the file states {}: numbers were changed after the file was written",
                text_from_hash(asset.hash()),
                text_from_hash(hash)
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
            layers: Vec::new(),
            stand_in: None,
            warnings,
        })
    }

    /// The frame is read from the metadata; warns if the stage was moved since.
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
            warnings.push(format!("the transformation of /{SCENE} differs from the metadata, which count"));
        }
    }

    fn format(&self) -> &'static str {
        match (&self.entries, self.table_bytes) {
            (Some(_), _) => "OpenUSD package (usdz)",
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

    /// Asset paths of the pages in the material of a particle field.
    fn page_paths(&self, field: &Prim, prims: &[(String, &Prim)]) -> Vec<String> {
        let Some(Content::Relationship { target }) = field.property(BINDING).map(|p| &p.content) else {
            return Vec::new();
        };
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

    /// Reads the texels of maps; returns the bytes of pages in sidecar files.
    fn texels(
        &self,
        field: &Prim,
        prims: &[(String, &Prim)],
        asset: &mut SplatAsset,
        limits: &ReadLimits,
    ) -> Result<u64> {
        let reader = Field { path: self.path, prim: field };
        let atlas = reader.atlas(asset.num_splats())?;
        let paths = self.page_paths(field, prims);
        if atlas.pages.len() != paths.len() {
            let what =
                format!("{} pages in {PAGE_SIZES}, but {} in the material", atlas.pages.len(), paths.len());
            return Err(Error::invalid(self.path, what));
        }
        atlas.check(&asset.maps).map_err(|e| e.at(self.path))?;
        let table = reader.decode()?.map(|decode| decode.table());
        let texel_bytes = if table.is_some() { 3 } else { 12 };
        let mut files = Vec::new();
        let mut image_bytes = 0;
        for (path, &[width, height]) in paths.iter().zip(&atlas.pages) {
            let bytes = self.image(path, limits.decoded_bytes.saturating_sub(image_bytes))?;
            if self.entries.is_none() {
                image_bytes += bytes.len() as u64;
            }
            let raw = u64::from(width) * u64::from(height) * texel_bytes;
            if raw > (bytes.len() as u64).saturating_mul(IMAGE_EXPANSION_MAX) {
                let what = format!("{} bytes for {width} x {height} texels", bytes.len());
                return Err(Error::invalid(self.path, what).within(&page_named(path)));
            }
            files.push(bytes);
        }
        let num_texels: usize = asset.maps.iter().map(|m| m.num_texels()).sum();
        let decoded = 12 * num_texels as u64 + MapRows::num_bytes(&asset.maps);
        limits.of_file(self.file_bytes + image_bytes).check(decoded, "texels", self.path)?;
        let rows = MapRows::new(&atlas, &asset.maps).map_err(|e| e.at(self.path))?;
        asset.texels = filled(3 * num_texels, 0.0).map_err(|e| e.at(self.path))?;
        let texels = &mut asset.texels;
        for (i, (bytes, name)) in files.iter().zip(&paths).enumerate() {
            let (page, size) = (rows.on_page(i), atlas.pages[i]);
            if page.is_empty() {
                continue;
            }
            let copied = match &table {
                Some(table) => page.copy_png(bytes, size, table, texels, self.path),
                None => page.copy_exr(bytes, size, texels, self.path),
            };
            copied.map_err(|e| e.within(&page_named(name)))?;
        }
        Ok(image_bytes)
    }
}

/// A page in messages; by this beginning, validation tells what is wrong with pages from the rest.
fn page_named(name: &str) -> String {
    format!("{PAGE_PLACE}{}", quoted(name))
}

/// See [`page_named`].
pub(super) const PAGE_PLACE: &str = "page ";

/// A path without its variants: `{set=variant}` becomes `/`.
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
