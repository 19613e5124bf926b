import type { Splats } from '../../scene';
import { NO_SPLATS, shWidth } from '../splats';

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
  readonly texels: number;
  /** Exponents of the steps; empty in lossless files. */
  readonly exponents: Int32Array;
}

/** SH coefficients of a chunk: those of each splat's own degree, RGB. Those of degree 0 are left out of `sh` as 0. */
export interface Sh {
  readonly degrees: Uint8Array;
  readonly sh: Float32Array;
}

/** Texels of a chunk, and SH of degree 0 to be shown with them. */
export interface Texels {
  readonly texels: Float32Array;
  readonly dc: Float32Array;
}

/** Decodes the blocks of chunks; errors are of SceneError. */
export interface ChunkDecoder {
  geometry(data: Uint8Array, count: number): Geometry;
  sh(data: Uint8Array, geometry: Geometry): Sh;
  texels(data: Uint8Array, geometry: Geometry): Texels;
}

/** Room for the SH of splats of these degrees. */
export function roomForSh(degrees: Uint8Array): Sh {
  return { degrees, sh: new Float32Array(degrees.reduce((sum, degree) => sum + shWidth(degree), 0)) };
}

/** The splats of a chunk from the blocks that are there. */
export function splatsOf(geometry: Geometry, sh: Sh | null, texels: Texels | null): Splats {
  const { count, positions, rotations, scales, opacities } = geometry;
  const degrees = sh?.degrees ?? new Uint8Array(count);
  const dc = texels?.dc ?? geometry.dcShown;
  const all = sh?.sh.slice() ?? new Float32Array(3 * count);
  for (let i = 0, at = 0; i < count; i += 1) {
    for (let c = 0; c < 3; c += 1) all[at + c] = dc[3 * i + c];
    at += shWidth(degrees[i]);
  }
  const maps =
    texels === null
      ? { ...NO_MAPS(count), texels: NO_SPLATS.texels }
      : { rows: geometry.rows, cols: geometry.cols, texelSizes: geometry.texelSizes, shifts: geometry.shifts, texels: texels.texels };
  return { count, positions, rotations, scales, opacities, shDegrees: degrees, sh: all, ...maps };
}

const NO_MAPS = (count: number) => ({
  rows: new Uint16Array(count),
  cols: new Uint16Array(count),
  texelSizes: new Float32Array(2 * count),
  shifts: new Int16Array(2 * count),
});

/** Stores a position of the local frame, y down, as one with y up. */
export function putPosition(positions: Float32Array, i: number, x: number, y: number, z: number): void {
  positions[3 * i] = x;
  positions[3 * i + 1] = -y;
  positions[3 * i + 2] = -z;
}

/** Stores a rotation of the local frame as xyzw of the frame with y up: half a turn about x from the left. */
export function putRotation(rotations: Float32Array, i: number, w: number, x: number, y: number, z: number): void {
  rotations[4 * i] = w;
  rotations[4 * i + 1] = -z;
  rotations[4 * i + 2] = y;
  rotations[4 * i + 3] = -x;
}
