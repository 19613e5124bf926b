// Layout of a splat's parameters, in the order of `SplatGroup`, and its record. SH has as many floats as the splat's degree
// needs.

const POSITION = 0u;
const QUATERNION = 3u;
const LOG_SCALE = 7u;
const OPACITY = 9u;
const SH = 10u;

// What a splat has besides its parameters. Mirrors `layout::SplatInfo`.
struct SplatInfo {
    map_offset_texels: u32,
    // rows | cols << 16
    map_size: u32,
    // Edges of a texel along u and v, local units.
    texel_sizes: vec2f,
    // Texture coordinates of the splat's centre.
    map_origin: vec2f,
    // Step up to which SH and texels have been flushed.
    last_step: u32,
    // First float of its parameters << 2 | SH degree.
    parameters: u32,
}

// These take `SplatInfo.parameters`.
fn first_float(parameters: u32) -> u32 {
    return parameters >> 2u;
}

fn sh_degree(parameters: u32) -> u32 {
    return parameters & 3u;
}

fn num_floats(parameters: u32) -> u32 {
    return SH + 3u * sh_coefficients(sh_degree(parameters));
}

fn map_rows(map_size: u32) -> u32 {
    return map_size & 0xffffu;
}

fn map_cols(map_size: u32) -> u32 {
    return map_size >> 16u;
}

fn num_texels(map_size: u32) -> u32 {
    return map_rows(map_size) * map_cols(map_size);
}

// Columns of local_from_surfel, from a quaternion wxyz of any non-zero length.
fn rotation_of(q: vec4f) -> mat3x3f {
    let unit = q / length(q);
    let w = unit.x;
    let x = unit.y;
    let y = unit.z;
    let z = unit.w;
    return mat3x3f(
        vec3f(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        vec3f(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        vec3f(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    );
}

fn sh_coefficients(degree: u32) -> u32 {
    return (degree + 1u) * (degree + 1u);
}
