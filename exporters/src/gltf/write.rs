//! Writes `.glb` and `.gltf` files: splat attributes, atlas pages, the JSON document.

use super::attributes::{self, AttributeAccessors};
use super::buffer::{Arrays, Use};
use super::document::{
    AssetInfo, Buffer, Document, Image, MIME_PNG, MODE_POINTS, Mesh, Node, Primitive, PrimitiveExtensions,
    Scene, Texture,
};
use super::extension::{Decode, Digest, Page, Splatting, Stream, TextureExtension};
use super::stream::{MIME_LTGS, embeds_file};
use super::{EXTENSION, KHR, cameras, container, files};
use crate::asset::meta::Meta;
use crate::atlas::{Atlas, PAGE_SIDE, PAGE_SIDE_MAX, TexelDecode, ZERO, encode_exr, encode_png};
use crate::fallback::shown_cameras::Cameras;
use crate::files::staging::{SidecarFile, Staged};
use crate::math::yup;
use crate::{Error, Quality, ReadLimits, Result, SplatAsset, ltgs};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// How to write a glTF file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfOptions<'a> {
    /// How exactly the file keeps the scene. Lossless and balanced files have atlas pages, others hold a `.ltgs` file.
    pub quality: Quality,
    /// Largest side of an atlas page, texels; at most 8192.
    pub page_side: u16,
    /// Quantisation steps of the `.ltgs` file; `None` takes those of the quality.
    pub steps: Option<ltgs::Steps>,
    /// What is known of the splats, for the `.ltgs` file.
    pub per_splat: ltgs::PerSplat<'a>,
    /// A small scene that the `.ltgs` file shows first.
    pub stand_in: Option<ltgs::StandIn<'a>>,
    /// Cameras for other programs; the metadata hold all.
    pub cameras: Cameras,
}

impl Default for GltfOptions<'_> {
    fn default() -> Self {
        Self {
            quality: Quality::default(),
            page_side: PAGE_SIDE,
            steps: None,
            per_splat: ltgs::PerSplat::default(),
            stand_in: None,
            cameras: Cameras::default(),
        }
    }
}

/// Encodes a `.glb`.
///
/// # Errors
/// [`Error::Invalid`] if the asset breaks a rule or is empty, [`Error::TooLarge`] beyond 4 GiB or for maps larger than a page.
pub fn encode_glb(asset: &SplatAsset, options: &GltfOptions<'_>) -> Result<Vec<u8>> {
    let assembled = assemble(asset, options, None)?;
    container::glb(json(&assembled.document)?, assembled.bin)
}

/// Writes a `.glb`, or a `.gltf` with its arrays in `NAME.bin` and its pages in `NAME_atlas_0.png` or `.exr` and so on, by
/// the extension of `path`. Returns all files, the one at `path` first.
///
/// # Errors
/// As [`encode_glb`], and [`Error::Io`].
pub fn write_gltf(path: &Path, asset: &SplatAsset, options: &GltfOptions<'_>) -> Result<Vec<PathBuf>> {
    let (root, side) = encode_files(path, asset, options)?;
    Ok(Staged::new(path, root, side)?.publish(true)?.files)
}

/// Encodes the file at `path`, `.glb` or `.gltf`, and its sidecar files.
///
/// # Errors
/// As [`encode_glb`].
pub(crate) fn encode_files(
    path: &Path,
    asset: &SplatAsset,
    options: &GltfOptions<'_>,
) -> Result<(Vec<u8>, Vec<SidecarFile>)> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glb")) {
        return Ok((encode_glb(asset, options).map_err(|e| e.at(path))?, Vec::new()));
    }
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf")) {
        return Err(Error::invalid(path, "the name of a glTF file ends in .glb or .gltf"));
    }
    let stem = files::stem(path)?;
    let assembled = assemble(asset, options, Some(stem)).map_err(|e| e.at(path))?;
    let text = json(&assembled.document).map_err(|e| e.at(path))?;
    let pages = assembled.files.into_iter().map(|(name, bytes)| (name.into(), bytes));
    let bin = (files::arrays_name(stem).into(), assembled.bin);
    Ok((text, pages.chain([bin]).collect()))
}

/// Encodes a document as JSON, without the properties that are `None`.
pub fn json(document: &Document) -> Result<Vec<u8>> {
    fn leave_nulls_out(value: &mut Value) {
        match value {
            Value::Object(properties) => {
                properties.retain(|_, value| !value.is_null());
                properties.values_mut().for_each(leave_nulls_out);
            }
            Value::Array(items) => items.iter_mut().for_each(leave_nulls_out),
            _ => {}
        }
    }
    let mut value = serde_json::to_value(document).map_err(|e| invalid!("", "JSON: {e}"))?;
    leave_nulls_out(&mut value);
    serde_json::to_vec(&value).map_err(|e| invalid!("", "JSON: {e}"))
}

/// The parts of a file, without container.
struct Assembled {
    document: Document,
    bin: Vec<u8>,
    /// Names and bytes of pages in sidecar files.
    files: Vec<(String, Vec<u8>)>,
}

/// Assembles a file: a `.gltf` whose sidecar files begin with `stem`, or the contents of a `.glb`.
fn assemble(asset: &SplatAsset, options: &GltfOptions<'_>, stem: Option<&str>) -> Result<Assembled> {
    asset.validate()?;
    if asset.num_splats() == 0 {
        return Err(Error::invalid("", "no splats: a glTF primitive cannot be empty"));
    }
    if options.page_side == 0 || options.page_side > PAGE_SIDE_MAX {
        let what = format!("pages of {} texels per side, expected 1 to {PAGE_SIDE_MAX}", options.page_side);
        return Err(Error::invalid("", what));
    }
    if embeds_file(options.quality) {
        return streamed(asset, options, stem);
    }
    let mut writer = Writer { stem, ..Writer::default() };
    let described = match options.quality {
        Quality::Lossless => {
            // Pages as they are would grow by their borders, a twentieth of the file of small maps.
            let atlas = Atlas::of(asset, options.page_side)?;
            writer.described(asset, &atlas, options.quality, Writer::lossless_pages)?
        }
        _ => {
            let atlas = Atlas::with_border(asset, options.page_side)?;
            // Everything else in the file is made from what a reader gets.
            let decode = TexelDecode::finest(&asset.texels);
            let codes: Vec<u8> = asset.texels.iter().map(|&t| decode.code(t)).collect();
            let mut kept = asset.clone();
            kept.texels.iter_mut().zip(&codes).for_each(|(t, &code)| *t = decode.texel(code));
            let pages = |writer: &mut Writer<'_>, asset: &SplatAsset, atlas: &Atlas| {
                writer.coded_pages(asset, atlas, &codes, decode)
            };
            writer.described(&kept, &atlas, options.quality, pages)?
        }
    };
    writer.finish(asset, options.cameras, described)
}

/// Assembles a file that holds a `.ltgs` file, and small attributes for other viewers.
fn streamed(asset: &SplatAsset, options: &GltfOptions<'_>, stem: Option<&str>) -> Result<Assembled> {
    let GltfOptions { quality, steps, per_splat, stand_in, .. } = *options;
    let bytes = ltgs::encode(
        asset,
        &ltgs::LtgsOptions { quality, steps, per_splat, stand_in, ..ltgs::LtgsOptions::default() },
    )?;
    // The attributes are made from what a reader gets.
    let kept = ltgs::decode(&bytes, Path::new(""), &ReadLimits::default())?.asset;
    let mut writer = Writer { stem, ..Writer::default() };
    // First, so that viewers of it can begin before the rest has arrived.
    let stream = Stream { buffer_view: writer.arrays.push_bytes(&bytes), mime_type: MIME_LTGS.to_owned() };
    let attributes = attributes::small(&mut writer.arrays, &kept);
    let extension = TextureExtension { stream: Some(stream), ..TextureExtension::new(quality, kept.hash()) };
    writer.finish(&kept, options.cameras, (attributes, extension))
}

/// The primitive of splats.
fn points(
    asset: &SplatAsset,
    attributes: AttributeAccessors,
    extension: TextureExtension,
) -> Result<Primitive> {
    let digest = Digest::of(asset, extension.hash.clone());
    let extension = serde_json::to_value(extension).map_err(|e| invalid!("", "{EXTENSION}: {e}"))?;
    let splatting = Some(Splatting::new(asset.colour_space, extension));
    Ok(Primitive {
        attributes,
        mode: Some(MODE_POINTS),
        extensions: Some(PrimitiveExtensions { splatting }),
        extras: Some(digest.to_extras()),
        ..Primitive::default()
    })
}

/// The object `asset` of every file that is written.
pub fn asset_info(asset: &SplatAsset) -> AssetInfo {
    let facts = &asset.provenance;
    let copyright: Vec<&str> =
        [facts.author.as_str(), &facts.licence].into_iter().filter(|s| !s.is_empty()).collect();
    AssetInfo {
        version: "2.0".to_owned(),
        min_version: None,
        generator: Some(format!("litetex {}", env!("CARGO_PKG_VERSION"))),
        copyright: (!copyright.is_empty()).then(|| copyright.join(", ")),
    }
}

/// What describes the splats of a file.
type Described = (AttributeAccessors, TextureExtension);

/// The properties of our extension that describe pages.
type Pages = (Vec<Page>, Option<Decode>);

/// Collects the arrays and images of a file.
#[derive(Default)]
struct Writer<'a> {
    arrays: Arrays,
    textures: Vec<Texture>,
    images: Vec<Image>,
    files: Vec<(String, Vec<u8>)>,
    stem: Option<&'a str>,
}

impl Writer<'_> {
    fn described(
        &mut self,
        asset: &SplatAsset,
        atlas: &Atlas,
        quality: Quality,
        pages: impl FnOnce(&mut Self, &SplatAsset, &Atlas) -> Result<Pages>,
    ) -> Result<Described> {
        let (attributes, sh0) = attributes::exact(&mut self.arrays, asset);
        let has_maps = !asset.texels.is_empty();
        let used = Use::Other(None);
        let has_degrees = asset.sh_degrees.iter().any(|&degree| u32::from(degree) != asset.sh_degree);
        let sh_degree = has_degrees.then(|| self.arrays.push(asset.sh_degrees.iter().map(|&d| [d]), used));
        let rects = asset.maps.iter().zip(&atlas.placements).map(|(m, at)| [at.x, at.y, m.cols, m.rows]);
        let rects = has_maps.then(|| self.arrays.push(rects, used));
        let page_indices = atlas.placements.iter().map(|at| at.page);
        let page_indices = match atlas.pages.len() {
            0 | 1 => None,
            // Indices below 256: no bits are lost.
            2..=256 => Some(self.arrays.push(page_indices.map(|p| [p as u8]), used)),
            _ => Some(self.arrays.push(page_indices.map(|p| [p]), used)),
        };
        let texel_sizes = asset.maps.iter().map(|m| m.texel_sizes);
        let texel_size = has_maps.then(|| self.arrays.push(texel_sizes, used));
        let is_shifted = asset.maps.iter().any(|m| m.shift != [0; 2]);
        let shift = is_shifted.then(|| self.arrays.push(asset.maps.iter().map(|m| m.shift), used));
        let border = (has_maps && atlas.border > 0).then_some(atlas.border);
        let (atlas, decode) = if has_maps { pages(self, asset, atlas)? } else { (Vec::new(), None) };
        let extension = TextureExtension {
            rects,
            pages: page_indices,
            texel_size,
            shift,
            sh_degree,
            sh0,
            atlas,
            border,
            decode,
            meta: Some(Meta::of(asset)),
            ..TextureExtension::new(quality, asset.hash())
        };
        Ok((attributes, extension))
    }

    /// Adds pages that keep texels bit for bit.
    fn lossless_pages(&mut self, asset: &SplatAsset, atlas: &Atlas) -> Result<Pages> {
        let mut pages = Vec::new();
        for (i, texels) in atlas.pages_from_texels(&asset.maps, &asset.texels, 0.0).into_iter().enumerate() {
            let size = atlas.pages[i];
            let mut page = Page { width: size[0].into(), height: size[1].into(), ..Page::default() };
            if let Some(stem) = self.stem {
                let name = files::page_name(stem, i, "exr");
                page.uri = Some(files::uri_from_name(&name));
                self.files.push((name, encode_exr(size, &texels)?));
            } else {
                let view = self.arrays.begin_view(None);
                self.arrays.bytes.reserve_exact(4 * texels.len());
                self.arrays.bytes.extend(texels.iter().flat_map(|t| t.to_le_bytes()));
                self.arrays.end_view();
                page.buffer_view = Some(view);
            }
            pages.push(page);
        }
        Ok((pages, None))
    }

    /// Adds pages of 8 bits as core textures.
    fn coded_pages(
        &mut self,
        asset: &SplatAsset,
        atlas: &Atlas,
        codes: &[u8],
        decode: TexelDecode,
    ) -> Result<Pages> {
        let mut pages = Vec::new();
        for (i, rgb) in atlas.pages_from_texels(&asset.maps, codes, ZERO).into_iter().enumerate() {
            let size = atlas.pages[i];
            let png = encode_png(size, &rgb)?;
            let mut image = Image { name: Some(format!("residuals {i}")), ..Image::default() };
            image.mime_type = Some(MIME_PNG.to_owned());
            if let Some(stem) = self.stem {
                let name = files::page_name(stem, i, "png");
                image.uri = Some(files::uri_from_name(&name));
                self.files.push((name, png));
            } else {
                image.buffer_view = Some(self.arrays.push_bytes(&png));
            }
            self.images.push(image);
            self.textures.push(Texture { sampler: Some(0), source: Some(i as u32) });
            let [width, height] = size.map(u32::from);
            pages.push(Page { width, height, texture: Some(i as u32), ..Page::default() });
        }
        Ok((pages, Some(Decode { scale: decode.scale, bias: decode.bias })))
    }

    fn finish(
        self,
        asset: &SplatAsset,
        cameras: Cameras,
        (attributes, mut extension): Described,
    ) -> Result<Assembled> {
        let buffer_uri = self.stem.map(|stem| files::uri_from_name(&files::arrays_name(stem)));
        if let Some(uri) = &buffer_uri {
            extension.sidecars.add(uri, &self.arrays.bytes);
            self.files
                .iter()
                .for_each(|(name, bytes)| extension.sidecars.add(&files::uri_from_name(name), bytes));
        }
        let primitive = points(asset, attributes, extension)?;
        let title = Some(asset.provenance.title.clone()).filter(|t| !t.is_empty());
        // Nearest and clamped: filters must not mix neighbours.
        let sampler = serde_json::json!({
            "magFilter": 9728, "minFilter": 9728, "wrapS": 33_071, "wrapT": 33_071
        });
        let mut nodes = vec![node(asset)];
        let cameras = cameras::push(asset, cameras, &mut nodes);
        let document = Document {
            asset: asset_info(asset),
            extensions_used: vec![KHR.to_owned(), EXTENSION.to_owned()],
            scene: Some(0),
            scenes: vec![Scene { name: title.clone(), nodes: (0..nodes.len() as u32).collect() }],
            nodes,
            cameras,
            meshes: vec![Mesh { name: title, primitives: vec![primitive] }],
            samplers: if self.textures.is_empty() { Vec::new() } else { vec![sampler] },
            textures: self.textures,
            images: self.images,
            accessors: self.arrays.accessors,
            buffer_views: self.arrays.views,
            buffers: vec![Buffer { byte_length: self.arrays.bytes.len() as u64, uri: buffer_uri }],
            ..Document::default()
        };
        Ok(Assembled { document, bin: self.arrays.bytes, files: self.files })
    }
}

/// The node that shows mesh 0 in the world frame with y up.
pub fn node(asset: &SplatAsset) -> Node {
    let world_from_node = yup::node(&asset.world_from_local());
    let [w, x, y, z] = world_from_node.rotation;
    Node {
        name: Some(asset.provenance.title.clone()).filter(|title| !title.is_empty()),
        mesh: Some(0),
        translation: Some(world_from_node.translation),
        rotation: Some([x, y, z, w]),
        scale: Some([world_from_node.scale; 3]),
        ..Node::default()
    }
}
