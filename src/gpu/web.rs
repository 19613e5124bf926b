//! The kernels by themselves, for tests that compile them in browsers.

use super::kernels::KERNELS;
use super::shader::{ExpandedShader, HALF_TILES, expand};
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
}

/// All kernels and their variants, with tiles of both heights if the kernel depends on it.
///
/// # Errors
/// [`Error::Device`] with file and line if the preprocessor fails.
pub fn web_shaders() -> Result<Vec<WebShader>> {
    let mut out: Vec<WebShader> = Vec::new();
    for (_, kernel) in KERNELS {
        for tiles in [&[][..], &[HALF_TILES]] {
            let flags = [kernel.flags, tiles].concat();
            let shader = expand(kernel.name, &flags).map_err(Error::Device)?;
            // Most kernels only define the height of tiles and never use it.
            let heights = ["TILE_ROWS_PX", "TILE_SIZE_PX", "RASTER_GROUP"];
            let mut code = shader.text.lines().filter(|line| !line.starts_with("const "));
            let uses_height = code.any(|line| heights.iter().any(|name| line.contains(name)));
            if uses_height || tiles.is_empty() {
                let name = std::iter::once(kernel.name).chain(flags).collect::<Vec<_>>().join(" ");
                out.push(WebShader { name, entry_point: kernel.name, shader });
            }
        }
    }
    Ok(out)
}
