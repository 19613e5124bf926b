//! Names of prims, properties and metadata of our files, shared by writers, readers and validation.

/// Version of the meaning of `primvars:litetex:*`.
pub(super) const VERSION: i32 = 3;

/// Name of the root prim.
pub(super) const SCENE: &str = "Scene";
/// Name of the root prim with the cameras.
pub(super) const CAMERAS: &str = "Cameras";
/// Name of the camera of the home view: by this name OpenUSD's tools look for the camera to use.
pub(super) const MAIN_CAMERA: &str = "main_cam";
/// Name of a camera's photo.
pub(super) const PHOTO: &str = "litetex:photo";
/// Name of the prim with the splats of a variant.
pub(super) const SPLATS: &str = "Splats";
/// Name of the material whose shaders refer to the pages.
pub(super) const ATLAS: &str = "Atlas";
/// Name of the variant set with the representations.
pub(super) const REPRESENTATION: &str = "representation";

/// Type of particle fields without a built-in kernel.
pub(super) const FIELD_TYPE: &str = "ParticleField";
/// Type of particle fields of 3D Gaussians.
pub(super) const SPLAT3D_TYPE: &str = "ParticleField3DGaussianSplat";
/// Prefix of all kernel schemas.
pub(super) const KERNEL_PREFIX: &str = "ParticleFieldKernel";
/// Schemas that are applied to the textured splats.
pub(super) const FIELD_SCHEMAS: [&str; 7] = [
    "ParticleFieldPositionAttributeAPI",
    "ParticleFieldOrientationAttributeAPI",
    "ParticleFieldScaleAttributeAPI",
    "ParticleFieldOpacityAttributeAPI",
    "ParticleFieldSphericalHarmonicsAttributeAPI",
    "ParticleFieldKernelGaussianSurfletAPI",
    "MaterialBindingAPI",
];

pub(super) const POSITIONS: &str = "positions";
pub(super) const ORIENTATIONS: &str = "orientations";
pub(super) const SCALES: &str = "scales";
pub(super) const OPACITIES: &str = "opacities";
pub(super) const SH_DEGREE: &str = "radiance:sphericalHarmonicsDegree";
pub(super) const SH_COEFFICIENTS: &str = "radiance:sphericalHarmonicsCoefficients";
pub(super) const EXTENT: &str = "extent";
pub(super) const BINDING: &str = "material:binding";

pub(super) const LITETEX_VERSION: &str = "primvars:litetex:version";
/// x, y, columns, rows.
pub(super) const RECT: &str = "primvars:litetex:rect";
pub(super) const PAGE: &str = "primvars:litetex:page";
pub(super) const TEXEL_SIZE: &str = "primvars:litetex:texelSize";
/// Half texels; absent if all maps are centred.
pub(super) const SHIFT: &str = "primvars:litetex:shift";
/// Degrees of splats; absent if all have that of the field.
pub(super) const OWN_SH_DEGREE: &str = "primvars:litetex:shDegree";
/// SH of degree 0 without the mean of the map.
pub(super) const SH0: &str = "primvars:litetex:sh0";
pub(super) const DECODE_SCALE: &str = "primvars:litetex:decodeScale";
pub(super) const DECODE_BIAS: &str = "primvars:litetex:decodeBias";
/// Widths and heights of the pages.
pub(super) const PAGE_SIZES: &str = "litetex:pageSizes";

/// Key of our dictionary in the layer's custom data.
pub(super) const LITETEX: &str = "litetex";
/// Key in it of the hashes of images that are files of their own.
pub(super) const SIDECARS: &str = "sidecars";
