//! Reads `.glb` and `.gltf` files.

use super::accessor::Component;
use super::extension::TextureExtension;
use super::loaded::{Loaded, SidecarFiles};
use super::pages::own_array;
use super::scene::Found;
use super::splats::Attributes;
use super::{EXTENSION, KHR, VERSION, container, node, pages, scene};
use crate::files::read::read_file;
use crate::math::yup;
use crate::{
    Contents, Describes, Error, Quality, ReadLimits, Result, Section, SplatAsset, Transform, quoted,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Relative difference up to which a node counts as unchanged since it was written.
const NODE_TOLERANCE: f64 = 1e-6;

/// Reads a file and its sidecar files. See [`decode_glb`].
///
/// # Errors
/// As [`decode_glb`], and [`Error::Io`]. URIs that leave the file's folder are [`Error::Invalid`].
pub fn read_gltf(path: &Path, limits: &ReadLimits) -> Result<Contents> {
    let bytes = read_file(path, limits.decoded_bytes)?;
    decode(&bytes, path, limits, SidecarFiles::Read)
}

/// Decodes the bytes of a `.glb`; `path` is only for messages. Reads splats of other programs, too, as untextured discs
/// along their two largest axes.
///
/// # Errors
/// [`Error::Invalid`] if the file is damaged or breaks a rule, [`Error::Unsupported`] for other versions, unknown required
/// extensions and sidecar files, [`Error::TooLarge`].
pub fn decode_glb(bytes: &[u8], path: &Path, limits: &ReadLimits) -> Result<Contents> {
    decode(bytes, path, limits, SidecarFiles::Refuse)
}

fn decode(bytes: &[u8], path: &Path, limits: &ReadLimits, sidecar_files: SidecarFiles) -> Result<Contents> {
    let loaded = Loaded::new(bytes, path, limits, sidecar_files)?;
    contents(&loaded, container::is_glb(bytes))
}

/// Reads the asset of a loaded file.
///
/// # Errors
/// As [`decode_glb`].
pub fn contents(loaded: &Loaded<'_>, is_glb: bool) -> Result<Contents> {
    let found = scene::find(&loaded.document, loaded.path)?;
    if found.primitive.mode != Some(super::document::MODE_POINTS) {
        let what = format!("{}: mode {:?}, splats are POINTS (0)", found.pointer, found.primitive.mode);
        return Err(Error::invalid(loaded.path, what));
    }
    let attributes = Attributes::find(loaded, found.primitive)?;
    let mut warnings = Vec::new();
    let mut contents = match found.splatting.texture() {
        Some(value) => {
            let extension = TextureExtension::parse(value, loaded.path)?;
            ours(loaded, &found, &attributes, extension, &mut warnings)?
        }
        None => foreign(loaded, &found, &attributes, &mut warnings)?,
    };
    contents.asset.validate().map_err(|e| e.at(loaded.path))?;
    if contents.hash.is_some_and(|hash| hash != contents.asset.hash()) {
        warnings.push("the content does not match its hash: a tool has changed values".to_owned());
    }
    contents.format = format!("glTF 2.0 ({}), {}", if is_glb { ".glb" } else { ".gltf" }, contents.format);
    contents.warnings = warnings;
    Ok(contents)
}

/// Reads splats with our extension.
fn ours(
    loaded: &Loaded<'_>,
    found: &Found<'_>,
    attributes: &Attributes<'_>,
    extension: TextureExtension,
    warnings: &mut Vec<String>,
) -> Result<Contents> {
    if let Some(stream) = &extension.stream {
        let mut contents = stream.read(loaded, &extension, attributes.num_splats)?;
        warnings.append(&mut contents.warnings);
        check_colour_space(loaded, found, &contents.asset)?;
        place(loaded, found, &mut contents.asset, warnings)?;
        return Ok(contents);
    }
    let mut asset = attributes.surfels(loaded)?;
    // Those for other viewers, too, though exact ones may replace them.
    if let Some(splat) = attributes.first_dc_not_finite() {
        return Err(invalid!(loaded.path, "splat {splat}: SH of degree 0 for other viewers is not finite"));
    }
    if let Some(sh0) = extension.sh0 {
        read_sh0(loaded, sh0, &mut asset)?;
    }
    if let Some(degrees) = extension.sh_degree {
        read_sh_degrees(loaded, degrees, &mut asset)?;
    }
    pages::read_maps(loaded, &extension, &mut asset)?;
    let hash = extension.hash().ok_or_else(|| {
        invalid!(loaded.path, "{EXTENSION}: hash {} is not 16 digits", quoted(&extension.hash))
    })?;
    let quality = Quality::from_name(&extension.quality);
    if quality.is_none() {
        warnings.push(format!("unknown quality {}", quoted(&extension.quality)));
    }
    let sections = sections(loaded, found, Some(&extension));
    if let Some(meta) = extension.meta {
        meta.store(&mut asset);
    }
    check_colour_space(loaded, found, &asset)?;
    place(loaded, found, &mut asset, warnings)?;
    let format = format!("{EXTENSION} {VERSION}");
    Ok(Contents {
        asset,
        format,
        quality,
        hash: Some(hash),
        sections,
        layers: Vec::new(),
        stand_in: None,
        warnings: Vec::new(),
    })
}

/// Other viewers must be told the colour space of the metadata.
fn check_colour_space(loaded: &Loaded<'_>, found: &Found<'_>, asset: &SplatAsset) -> Result<()> {
    if found.splatting.colour_space(loaded.path)? == asset.colour_space {
        return Ok(());
    }
    let what =
        format!("{KHR}: colorSpace {} is not that of the metadata", quoted(&found.splatting.color_space));
    Err(Error::invalid(loaded.path, what))
}

/// Stores the exact SH coefficients of degree 0.
fn read_sh0(loaded: &Loaded<'_>, index: u32, asset: &mut SplatAsset) -> Result<()> {
    let view = own_array(loaded, index, "sh0", (3, &[Component::F32]), asset.num_splats())?;
    let width = 3 * crate::num_sh_coefficients(asset.sh_degree);
    for (splat, dc) in asset.sh.chunks_exact_mut(width).zip(view.rows::<3>()) {
        splat.iter_mut().zip(dc).for_each(|(c, v)| *c = v);
    }
    Ok(())
}

/// Stores the SH degrees of splats, whose coefficients have been read.
fn read_sh_degrees(loaded: &Loaded<'_>, index: u32, asset: &mut SplatAsset) -> Result<()> {
    let view = own_array(loaded, index, "shDegree", (1, &[Component::U8]), asset.num_splats())?;
    let degrees = view.rows::<1>().map(|[degree]| degree as u8).collect();
    asset.store_sh_degrees(degrees).map_err(|e| e.at(loaded.path))
}

/// Reads what a viewer of `KHR_gaussian_splatting` shows of a file: its ellipsoids as discs along their two largest axes.
/// Frame, near plane and cameras are those of [`read_gltf`], so that both can be rendered alike.
///
/// # Errors
/// As [`read_gltf`], except about arrays and pages of our extension, which are not read.
pub fn read_fallback(path: &Path, limits: &ReadLimits) -> Result<SplatAsset> {
    let bytes = read_file(path, limits.decoded_bytes)?;
    let loaded = Loaded::new(&bytes, path, limits, SidecarFiles::Read)?;
    let found = scene::find(&loaded.document, path)?;
    let attributes = Attributes::find(&loaded, found.primitive)?;
    let mut asset = foreign(&loaded, &found, &attributes, &mut Vec::new())?.asset;
    let value = found.splatting.texture();
    if let Some(extension) = value.and_then(|v| TextureExtension::parse(v, path).ok()) {
        let of_stream = extension.stream.map(|stream| stream.meta(&loaded)).transpose()?;
        if let Some(meta) = extension.meta.or(of_stream) {
            meta.store(&mut asset);
        }
        asset.colour_space = found.splatting.colour_space(path)?;
        place(&loaded, &found, &mut asset, &mut Vec::new())?;
    }
    asset.validate().map_err(|e| e.at(path))?;
    Ok(asset)
}

/// Reads splats without our extension, and what is meant for other programs of those with it: of these none may be broken.
fn foreign(
    loaded: &Loaded<'_>,
    found: &Found<'_>,
    attributes: &Attributes<'_>,
    warnings: &mut Vec<String>,
) -> Result<Contents> {
    let (mut asset, num_thick, broken) = attributes.flattened(loaded)?;
    if found.splatting.texture().is_some() {
        broken.refuse(loaded.path)?;
    } else {
        warnings.extend(broken.leave_out(&mut asset, loaded.path)?);
    }
    let mut sections = sections(loaded, found, None);
    sections.retain(|s| s.bytes > 0);
    if let Some(digest) = found.primitive.digest() {
        warnings.push(scene::lost(&digest));
    }
    if num_thick > 0 {
        warnings.push(format!(
            "{num_thick} of {} splats are thick: drawn as discs, they lose their thinnest axis",
            asset.num_splats()
        ));
    }
    if found.splatting.kernel != "ellipse" {
        let kernel = quoted(&found.splatting.kernel);
        warnings.push(format!("kernel {kernel} is not known, read as \"ellipse\""));
    }
    asset.colour_space = found.splatting.colour_space(loaded.path)?;
    asset.capture_from_local = frame(loaded, found, None, warnings)?;
    let info = &loaded.document.asset;
    asset.provenance.licence = info.copyright.clone().unwrap_or_default();
    asset.provenance.program_version = info.generator.clone().unwrap_or_default();
    let quality = None;
    Ok(Contents {
        asset,
        format: KHR.to_owned(),
        quality,
        hash: None,
        sections,
        layers: Vec::new(),
        stand_in: None,
        warnings: Vec::new(),
    })
}

/// Places an asset with metadata in the world where its node does.
fn place(
    loaded: &Loaded<'_>,
    found: &Found<'_>,
    asset: &mut SplatAsset,
    warnings: &mut Vec<String>,
) -> Result<()> {
    let world_from_local = frame(loaded, found, Some(asset.world_from_local()), warnings)?;
    if world_from_local != asset.world_from_local() {
        asset.world_from_capture = world_from_local.after(&asset.capture_from_local.inverse());
    }
    Ok(())
}

/// The transform to the file's frame: that of the metadata, if it agrees with the node, else that of the node.
fn frame(
    loaded: &Loaded<'_>,
    found: &Found<'_>,
    stored: Option<Transform>,
    warnings: &mut Vec<String>,
) -> Result<Transform> {
    let Some(node) = node::world_from_mesh(&loaded.document, found.mesh, loaded.path)? else {
        warnings.push("no node shows the splats".to_owned());
        return Ok(stored.unwrap_or(Transform::IDENTITY));
    };
    match stored {
        Some(stored) if is_alike(&node, &yup::node(&stored)) => Ok(stored),
        Some(_) => {
            warnings
                .push("the node was moved after the file was written: it is read where it is now".to_owned());
            Ok(yup::frame_of_node(&node))
        }
        None => Ok(yup::frame_of_node(&node)),
    }
}

fn is_alike(a: &Transform, b: &Transform) -> bool {
    let size = b.translation.iter().fold(b.scale, |size, v| size.max(v.abs()));
    let near = |a: f64, b: f64, size: f64| (a - b).abs() <= NODE_TOLERANCE * size;
    let sign =
        if a.rotation.iter().zip(b.rotation).map(|(p, q)| p * q).sum::<f64>() < 0.0 { -1.0 } else { 1.0 };
    near(a.scale, b.scale, b.scale)
        && (0..3).all(|i| near(a.translation[i], b.translation[i], size))
        && (0..4).all(|i| near(sign * a.rotation[i], b.rotation[i], 1.0))
}

/// Parts of the file by what they hold; the rest counts as metadata.
fn sections(loaded: &Loaded<'_>, found: &Found<'_>, extension: Option<&TextureExtension>) -> Vec<Section> {
    let mut parts: BTreeMap<(usize, &str), (u64, Describes)> = BTreeMap::new();
    let mut add = |order: usize, name, bytes, describes| {
        parts.entry((order, name)).or_insert((0, describes)).0 += bytes;
    };
    let size = |index: u32| loaded.accessor(index, "").map_or(0, |view| view.num_bytes());
    for (name, &index) in &found.primitive.attributes {
        let (order, name, describes) = match name.strip_prefix(KHR).unwrap_or(name) {
            "POSITION" => (0, "positions", Describes::Splats),
            ":ROTATION" => (1, "rotations", Describes::Splats),
            ":SCALE" => (2, "scales", Describes::Splats),
            ":OPACITY" => (3, "opacities", Describes::Splats),
            ":SH_DEGREE_0_COEF_0" if extension.is_some_and(|e| e.sh0.is_some_and(|sh0| sh0 != index)) => {
                (9, "fallback", Describes::Other)
            }
            ":SH_DEGREE_0_COEF_0" => (4, "sh0", Describes::Splats),
            name if name.starts_with(":SH_DEGREE_") => (5, "sh_rest", Describes::Splats),
            _ => (9, "fallback", Describes::Other),
        };
        add(order, name, size(index), describes);
    }
    if let Some(extension) = extension {
        let exact = extension.sh0.filter(|sh0| !found.primitive.attributes.values().any(|a| a == sh0));
        add(4, "sh0", exact.map_or(0, size), Describes::Splats);
        add(6, "sh_degrees", extension.sh_degree.map_or(0, size), Describes::Splats);
        let maps = [extension.rects, extension.pages, extension.texel_size, extension.shift];
        add(7, "maps", maps.into_iter().flatten().map(size).sum(), Describes::Splats);
        let texels = extension.atlas.iter().map(|page| pages::stored_bytes(loaded, page)).sum();
        add(8, "texels", texels, Describes::Texels);
    }
    let total = loaded.num_bytes.get();
    let known: u64 = parts.values().map(|(bytes, _)| bytes).sum();
    if known > total {
        // Arrays share bytes.
        let all = Section { name: "file".to_owned(), bytes: total, describes: Describes::Other };
        return vec![all];
    }
    parts.insert((10, "metadata"), (total - known, Describes::Other));
    let section = |((_, name), (bytes, describes)): ((usize, &str), (u64, Describes))| Section {
        name: name.to_owned(),
        bytes,
        describes,
    };
    parts.into_iter().map(section).collect()
}
