//! The kernels by themselves, for tests that compile them in browsers, and for other compilers.

use super::kernels::KERNELS;
use super::shader::{ExpandedShader, HALF_TILES, SEGMENTS, expand};
use crate::{Error, Result};

/// A kernel variant.
#[derive(Clone, Debug)]
pub struct WebShader {
    /// Name of the kernel and flags of the variant, for messages.
    pub name: String,
    /// Name of the entry point.
    pub entry_point: &'static str,
    /// Preprocessed WGSL.
    pub shader: ExpandedShader,
    /// Whether it needs subgroups, or runs only beside such kernels.
    pub needs_subgroups: bool,
}

/// All kernels that run without subgroups, and their variants, with tiles of both heights if the kernel depends on these. naga does
/// not know the directive by which browsers allow subgroups.
///
/// # Errors
/// [`Error::Device`] with file and line if the preprocessor fails.
pub fn web_shaders() -> Result<Vec<WebShader>> {
    Ok(all_shaders()?.into_iter().filter(|shader| !shader.needs_subgroups).collect())
}

/// As [`web_shaders`], with those that need subgroups, or run beside them.
///
/// # Errors
/// [`Error::Device`] with file and line if the preprocessor fails.
pub fn all_shaders() -> Result<Vec<WebShader>> {
    let mut out: Vec<WebShader> = Vec::new();
    for (_, kernel) in KERNELS {
        let native = expand(kernel.name, kernel.flags).map_err(Error::Device)?;
        for form in [&[][..], &[HALF_TILES], &[SEGMENTS]] {
            let flags = [kernel.flags, form].concat();
            let shader = expand(kernel.name, &flags).map_err(Error::Device)?;
            // Most kernels only define the height of tiles and never use it.
            let heights = ["TILE_ROWS_PX", "TILE_SIZE_PX", "RASTER_GROUP"];
            let mut code = shader.text.lines().filter(|line| !line.starts_with("const "));
            let uses_height = code.any(|line| heights.iter().any(|name| line.contains(name)));
            let is_another = match form {
                [] => true,
                [HALF_TILES] => uses_height,
                _ => shader.text != native.text,
            };
            if is_another {
                let name = std::iter::once(kernel.name).chain(flags).collect::<Vec<_>>().join(" ");
                let needs_subgroups = kernel.needs_subgroups() || form == [SEGMENTS];
                out.push(WebShader { name, entry_point: kernel.name, shader, needs_subgroups });
            }
        }
    }
    Ok(out)
}
