//! The kernels as browsers see them.

use super::kernels::KERNELS;
use super::shader::{Expanded, Target, expand};
use crate::{Error, Result};

/// A kernel in the form for browsers.
#[derive(Clone, Debug)]
pub struct WebShader {
    /// Name of the kernel and of its variant, for messages.
    pub name: String,
    /// Its entry point.
    pub entry_point: &'static str,
    /// Its text, and where each line comes from.
    pub shader: Expanded,
}

/// All kernels and their variants, expanded for browsers.
///
/// # Errors
/// [`Error::Device`] with the place in the sources if one cannot be expanded.
pub fn web_shaders() -> Result<Vec<WebShader>> {
    let shader = |kernel: &super::kernels::Kernel| {
        let expanded = expand(kernel.name, kernel.flags, Target::Web).map_err(Error::Device)?;
        let name = std::iter::once(kernel.name).chain(kernel.flags.iter().copied()).collect::<Vec<_>>();
        Ok(WebShader { name: name.join(" "), entry_point: kernel.name, shader: expanded })
    };
    KERNELS.iter().map(|(_, kernel)| shader(kernel)).collect()
}
