/** Cameras of other engines as views of a scene: the camera is moved into the frame of the data. */

import { centreOf, type View } from '../core/render/view';

/** Of 4 x 4 numbers, column by column. */
export type Matrix = ArrayLike<number>;

/** Part of a target that is drawn to, px from its lower left corner. */
export interface Viewport {
    readonly x: number;
    readonly y: number;
    readonly width: number;
    readonly height: number;
}

/** `a = scale * rotation * x + translation`. */
export interface Similarity {
    readonly scale: number;
    /** Row by row. */
    readonly rotation: readonly number[];
    readonly translation: readonly [number, number, number];
    /** False if the matrix is not quite one: stretched unevenly, sheared or mirrored. */
    readonly exact: boolean;
}

/** Deviation of rows from unit length and right angles that counts as rounding. */
const TOLERANCE = 1e-5;

/** The similarity closest to a transform; of one that mirrors, that of its x axis reversed. */
export function similarityOf(e: Matrix): Similarity {
    let r = [e[0], e[4], e[8], e[1], e[5], e[9], e[2], e[6], e[10]];
    const mirrored = determinant(r) < 0;
    if (mirrored) r = r.map((value, i) => (i % 3 === 0 ? -value : value));
    const linear = r;
    const size = Math.cbrt(determinant(r));
    r = r.map((value) => value / size);
    const even = deviation(r) < TOLERANCE;
    // Newton's iteration for the orthogonal factor of the polar decomposition; a single step removes rounding.
    for (let i = 0; i < (even ? 1 : 20) && size > 0; i++) {
        const c = cofactors(r), d = determinant(r);
        r = r.map((value, k) => 0.5 * (value + c[k] / d));
    }
    const scale = linear.reduce((sum, value, i) => sum + value * r[i], 0) / 3;
    return { scale, rotation: r, translation: [e[12], e[13], e[14]], exact: even && !mirrored };
}

function cofactors([a, b, c, d, e, f, g, h, i]: readonly number[]): number[] {
    return [e * i - f * h, f * g - d * i, d * h - e * g, c * h - b * i, a * i - c * g, b * g - a * h, b * f - c * e, c * d - a * f, a * e - b * d];
}

function determinant(m: readonly number[]): number {
    const c = cofactors(m);
    return m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
}

function deviation(m: readonly number[]): number {
    const rows = [0, 3, 6].map((i) => m.slice(i, i + 3));
    const dot = (a: number[], b: number[]) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return Math.max(...rows.flatMap((a, i) => rows.map((b, j) => Math.abs(dot(a, b) - (i === j ? 1 : 0)))));
}

export interface SplatView extends View {
    /** Where the camera stands, in the data. */
    readonly cameraInData: readonly [number, number, number];
    /** Depth of clip space = x + y / distance + slope . (px from the principal point), with distances in units of the data. */
    readonly depthFromInverse: readonly [number, number];
    readonly depthSlope: readonly [number, number];
    /** Units of the world per unit of the data. */
    readonly scale: number;
    /** Whether it shows what the engine would: not if the object is stretched, sheared or mirrored. */
    readonly exact: boolean;
}

function product(a: Matrix, b: Matrix): number[] {
    return Array.from({ length: 16 }, (_, i) => [0, 1, 2, 3].reduce((sum, k) => sum + a[4 * k + i % 4] * b[i - i % 4 + k], 0));
}

/**
 * What a camera that has y up and looks along -z sees of data that `worldFromData` brings into the world; null for cameras
 * without perspective. Any projection of a pinhole is allowed: off-centre, with a view offset, reversed depth, a tilted near plane.
 */
export function viewOfCamera(p: Matrix, cameraFromWorld: Matrix, worldFromData: Matrix, { width, height }: Viewport): SplatView | null {
    if (p[11] !== -1 || p[15] !== 0) return null;
    const { scale, rotation: r, translation: t, exact } = similarityOf(product(cameraFromWorld, worldFromData));
    const rotation = r.map((value, i) => (i < 3 ? value : -value));
    const translation = [t[0] / scale, -t[1] / scale, -t[2] / scale] as const;
    const focalPx = [0.5 * width * p[0], 0.5 * height * p[5]] as const;
    return {
        rotation,
        translation,
        focalPx,
        principalPx: [0.5 * width * (1 - p[8]), 0.5 * height * (1 + p[9])],
        widthPx: width,
        heightPx: height,
        cameraInData: centreOf({ rotation, translation }),
        depthFromInverse: [-p[10], p[14] / scale],
        depthSlope: [p[2] / focalPx[0], -p[6] / focalPx[1]],
        scale,
        exact: exact && scale > 0,
    };
}
