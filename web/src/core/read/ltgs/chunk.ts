import type { Splats } from '../../scene';
import { shWidth } from '../splats';
import type { Block } from './streams';

/** What the geometry block of a chunk says, with y up. */
export interface Geometry {
    readonly count: number;
    readonly positions: Float32Array;
    /** xyzw. */
    readonly rotations: Float32Array;
    readonly scales: Float32Array;
    readonly opacities: Float32Array;
    /** SH of degree 0 as stored, and as shown without texels. */
    readonly dc: Float32Array;
    readonly dcShown: Float32Array;
    readonly rows: Uint16Array;
    readonly cols: Uint16Array;
    readonly texelSizes: Float32Array;
    readonly shifts: Int16Array;
    /** Texels of all maps. */
    readonly texelCount: number;
    /** What the steps of a lossy chunk depend on. */
    readonly steppers?: Steppers;
}

/** The exponents x of the steps of splats, x + 8, and 2^x. */
export interface Steppers {
    readonly exponents: Int32Array;
    readonly classes: Uint8Array;
    readonly factors: Float64Array;
}

/** SH of a chunk: the coefficients of each splat's own degree, RGB; those of degree 0 are still 0. */
export interface Sh {
    readonly degrees: Uint8Array;
    readonly sh: Float32Array;
}

/** Texels of a chunk, and SH of degree 0 to be shown with them. */
export interface Texels {
    readonly texels: Float32Array;
    readonly dc: Float32Array;
}

/** What the other blocks depend on. */
export type Basis = Omit<Geometry, 'positions' | 'rotations' | 'opacities' | 'dcShown'>;

/** Decodes the blocks of chunks. */
export interface ChunkDecoder {
    geometry(block: Block, count: number): Geometry;
    /** For files of an SH degree above 0. */
    sh(block: Block, basis: Basis): Sh;
    texels(block: Block, basis: Basis): Texels;
}

/** Room for the SH of splats of these degrees. */
export function roomForSh(degrees: Uint8Array): Sh {
    return { degrees, sh: new Float32Array(degrees.reduce((sum, degree) => sum + shWidth(degree), 0)) };
}

/** Splats that have a degree, and where their coefficients of it begin. */
export function withDegree(degrees: Uint8Array, least: number): { readonly splats: number[]; readonly places: number[] } {
    const splats: number[] = [];
    const places: number[] = [];
    let at = 0;
    degrees.forEach((degree, i) => {
        if (degree >= least) {
            splats.push(i);
            places.push(at + shWidth(least - 1));
        }
        at += shWidth(degree);
    });
    return { splats, places };
}

/** The splats of a chunk from the blocks that are there. */
export function splatsOf(geometry: Geometry, sh?: Sh, texels?: Texels): Splats {
    const { count, positions, rotations, scales, opacities } = geometry;
    const { degrees, sh: stored } = sh ?? roomForSh(new Uint8Array(count));
    const dc = texels?.dc ?? geometry.dcShown;
    const all = stored.slice();
    for (let i = 0, at = 0; i < count; i += 1) {
        all.set(dc.subarray(3 * i, 3 * i + 3), at);
        at += shWidth(degrees[i]);
    }
    const isTextured = texels !== undefined;
    return {
        count,
        positions,
        rotations,
        scales,
        opacities,
        shDegrees: degrees,
        sh: all,
        rows: isTextured ? geometry.rows : new Uint16Array(count),
        cols: isTextured ? geometry.cols : new Uint16Array(count),
        texelSizes: isTextured ? geometry.texelSizes : new Float32Array(2 * count),
        shifts: isTextured ? geometry.shifts : new Int16Array(2 * count),
        texels: isTextured ? texels.texels : new Float32Array(0),
    };
}

/** Turns a position of the local frame, y down, to y up. */
export function putPosition(positions: Float32Array, i: number, x: number, y: number, z: number): void {
    positions[3 * i] = x;
    positions[3 * i + 1] = -y;
    positions[3 * i + 2] = -z;
}

/** Turns a rotation of the local frame to y up, half a turn about x from the left, and stores it as xyzw. */
export function putRotation(rotations: Float32Array, i: number, w: number, x: number, y: number, z: number): void {
    rotations[4 * i] = w;
    rotations[4 * i + 1] = -z;
    rotations[4 * i + 2] = y;
    rotations[4 * i + 3] = -x;
}
