//! Where the numbers of a splat are in its row.

use super::header::Element;
use crate::math::sh::{SH_DEGREE_MAX, SH_DEGREE_READ_MAX};
use crate::{Result, num_sh_coefficients};
use std::path::Path;

/// The columns of each quantity in a row.
pub(super) struct Columns {
    pub(super) position: [usize; 3],
    pub(super) dc: [usize; 3],
    pub(super) rest: Vec<usize>,
    /// Of the file.
    pub(super) stored_sh_degree: u32,
    /// Of the asset.
    pub(super) sh_degree: u32,
    pub(super) opacity: usize,
    pub(super) scales: Vec<usize>,
    pub(super) rotation: [usize; 4],
}

impl Columns {
    pub(super) fn find(vertex: &Element, path: &Path) -> Result<Self> {
        let index = |name: &str| vertex.properties.iter().position(|p| p.name == name);
        let required = |name: &str| {
            index(name).ok_or_else(|| {
                invalid!(path, "element \"vertex\" has no property {name:?}: not a file of splats")
            })
        };
        vertex.check_uncompressed(path)?;
        let numbered = |name: &str| (0..).map_while(|i| index(&format!("{name}_{i}"))).collect::<Vec<_>>();
        let rest = numbered("f_rest");
        let mut degrees = 0..=SH_DEGREE_READ_MAX;
        let stored_sh_degree =
            degrees.find(|&d| 3 * (num_sh_coefficients(d) - 1) == rest.len()).ok_or_else(|| {
                unsupported!(path, "{} properties f_rest_*; supported: 0, 9, 24, 45, 72", rest.len())
            })?;
        let mut scales = vec![required("scale_0")?, required("scale_1")?];
        scales.extend(index("scale_2"));
        Ok(Self {
            position: [required("x")?, required("y")?, required("z")?],
            dc: [required("f_dc_0")?, required("f_dc_1")?, required("f_dc_2")?],
            rest,
            stored_sh_degree,
            sh_degree: stored_sh_degree.min(SH_DEGREE_MAX),
            opacity: required("opacity")?,
            scales,
            rotation: [required("rot_0")?, required("rot_1")?, required("rot_2")?, required("rot_3")?],
        })
    }
}
