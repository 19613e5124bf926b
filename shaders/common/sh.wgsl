// Real spherical harmonics up to degree 3 with the constants, signs and order of 3DGS (twin: reference/sh.rs).

// Basis at a unit direction; entries above `degree` are 0.
fn sh_basis(degree: u32, d: vec3f) -> array<f32, 16> {
    var out = array<f32, 16>();
    let x = d.x;
    let y = d.y;
    let z = d.z;
    out[0] = SH_0;
    if degree >= 1u {
        out[1] = -SH_1 * y;
        out[2] = SH_1 * z;
        out[3] = -SH_1 * x;
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    if degree >= 2u {
        out[4] = SH_2[0] * x * y;
        out[5] = SH_2[1] * y * z;
        out[6] = SH_2[2] * (2.0 * zz - xx - yy);
        out[7] = SH_2[3] * x * z;
        out[8] = SH_2[4] * (xx - yy);
    }
    if degree >= 3u {
        out[9] = SH_3[0] * y * (3.0 * xx - yy);
        out[10] = SH_3[1] * x * y * z;
        out[11] = SH_3[2] * y * (4.0 * zz - xx - yy);
        out[12] = SH_3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
        out[13] = SH_3[4] * x * (4.0 * zz - xx - yy);
        out[14] = SH_3[5] * z * (xx - yy);
        out[15] = SH_3[6] * x * (xx - 3.0 * yy);
    }
    return out;
}

// Derivatives of the basis with respect to the components of the direction, treated as independent.
fn sh_basis_derivative(degree: u32, d: vec3f) -> array<vec3f, 16> {
    var out = array<vec3f, 16>();
    let x = d.x;
    let y = d.y;
    let z = d.z;
    if degree >= 1u {
        out[1] = vec3f(0.0, -SH_1, 0.0);
        out[2] = vec3f(0.0, 0.0, SH_1);
        out[3] = vec3f(-SH_1, 0.0, 0.0);
    }
    if degree >= 2u {
        out[4] = SH_2[0] * vec3f(y, x, 0.0);
        out[5] = SH_2[1] * vec3f(0.0, z, y);
        out[6] = SH_2[2] * vec3f(-2.0 * x, -2.0 * y, 4.0 * z);
        out[7] = SH_2[3] * vec3f(z, 0.0, x);
        out[8] = SH_2[4] * vec3f(2.0 * x, -2.0 * y, 0.0);
    }
    let xx = x * x;
    let yy = y * y;
    let zz = z * z;
    if degree >= 3u {
        out[9] = SH_3[0] * vec3f(6.0 * x * y, 3.0 * xx - 3.0 * yy, 0.0);
        out[10] = SH_3[1] * vec3f(y * z, x * z, x * y);
        out[11] = SH_3[2] * vec3f(-2.0 * x * y, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        out[12] = SH_3[3] * vec3f(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * xx - 3.0 * yy);
        out[13] = SH_3[4] * vec3f(4.0 * zz - 3.0 * xx - yy, -2.0 * x * y, 8.0 * x * z);
        out[14] = SH_3[5] * vec3f(2.0 * x * z, -2.0 * y * z, xx - yy);
        out[15] = SH_3[6] * vec3f(3.0 * xx - 3.0 * yy, -6.0 * x * y, 0.0);
    }
    return out;
}
