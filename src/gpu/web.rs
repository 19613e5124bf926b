//! The kernels as browsers see them.

use super::kernels::KERNELS;
use super::shader::{Dialect, ExpandedShader, HALF_TILES, expand};
use crate::{Error, Result};

/// A kernel in the form for browsers.
#[derive(Clone, Debug)]
pub struct WebShader {
    /// Name of the kernel and of its variant, for messages.
    pub name: String,
    /// Its entry point.
    pub entry_point: &'static str,
    /// Its text, and where each line comes from.
    pub shader: ExpandedShader,
}

/// All kernels and their variants, with tiles of both heights where it makes a difference, expanded for browsers.
///
/// # Errors
/// [`Error::Device`] with the place in the sources if one cannot be expanded.
pub fn web_shaders() -> Result<Vec<WebShader>> {
    let mut out: Vec<WebShader> = Vec::new();
    for (_, kernel) in KERNELS {
        for tiles in [&[][..], &[HALF_TILES]] {
            let flags = [kernel.flags, tiles].concat();
            let shader = expand(kernel.name, &flags, Dialect::Web).map_err(Error::Device)?;
            // Most kernels do not ask for the height of tiles: they only see it defined.
            let heights = ["TILE_ROWS_PX", "TILE_SIZE_PX", "RASTER_GROUP"];
            let mut code = shader.text.lines().filter(|line| !line.starts_with("const "));
            let asks = code.any(|line| heights.iter().any(|name| line.contains(name)));
            if asks || tiles.is_empty() {
                let name = std::iter::once(kernel.name).chain(flags).collect::<Vec<_>>().join(" ");
                out.push(WebShader { name, entry_point: kernel.name, shader });
            }
        }
    }
    Ok(out)
}
