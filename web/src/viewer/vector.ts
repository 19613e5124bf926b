/** Vectors of three and rotations, as plain arrays. */

export type Vec3 = [number, number, number];

export const add = (a: Vec3, b: Vec3, times = 1): Vec3 => [a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => add(a, b, -1);
export const scale = (a: Vec3, times: number): Vec3 => [a[0] * times, a[1] * times, a[2] * times];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec3, b: Vec3): Vec3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Vec3): number => Math.hypot(...a);

/** The unit vector; `otherwise` if there is none. */
export function normalize(a: Vec3, otherwise: Vec3 = [0, 1, 0]): Vec3 {
    const l = length(a);
    return l > 0 && l < Infinity ? scale(a, 1 / l) : otherwise;
}

/** `v` turned by `radians` around the unit vector `axis`. */
export function turned(v: Vec3, axis: Vec3, radians: number): Vec3 {
    const [c, s] = [Math.cos(radians), Math.sin(radians)];
    return add(add(scale(v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}
