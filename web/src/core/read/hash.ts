import type { SceneInfo, Splats } from '../scene';
import { SH_SIGNS, shWidth } from './splats';
import { Xxh3 } from './xxh3';

/** Splats whose numbers are turned at a time. */
const PIECE = 1024;

/**
 * The hash of a scene's content as 16 hexadecimal digits (`gltf.md`, section 9): over numbers with y down, one array after the
 * other. `parts` are all splats of the scene, in order.
 */
export function contentHash(parts: readonly Splats[], info: Pick<SceneInfo, 'near' | 'filter'>): string {
  const hasher = new Xxh3();
  const add = (array: ArrayBufferView): void => void hasher.update(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  /** Adds an array of `width` numbers a splat, turned. */
  const turned = (name: 'positions' | 'rotations', width: number, turn: (from: Float32Array, at: number, to: Float32Array, place: number) => void): void => {
    const piece = new Float32Array(PIECE * width);
    for (const { count, [name]: array } of parts) {
      for (let first = 0; first < count; first += PIECE) {
        const end = Math.min(first + PIECE, count);
        for (let i = first; i < end; i += 1) turn(array, width * i, piece, width * (i - first));
        add(piece.subarray(0, width * (end - first)));
      }
    }
  };
  add(Uint32Array.of(parts.reduce((sum, part) => sum + part.count, 0), info.filter === 'ewa' ? 1 : 0));
  add(Float32Array.of(info.near));
  turned('positions', 3, (from, at, to, place) => {
    to[place] = from[at];
    to[place + 1] = -from[at + 1];
    to[place + 2] = -from[at + 2];
  });
  turned('rotations', 4, (from, at, to, place) => {
    // wxyz with y down from xyzw with y up.
    to[place] = from[at];
    to[place + 1] = -from[at + 3];
    to[place + 2] = from[at + 2];
    to[place + 3] = -from[at + 1];
  });
  for (const part of parts) add(part.scales);
  for (const part of parts) add(part.opacities);
  for (const part of parts) add(part.shDegrees);
  for (const part of parts) addSh(part, add);
  for (const part of parts) addMaps(part, add);
  for (const part of parts) add(part.texels);
  return hasher.hex();
}

function addSh({ count, shDegrees, sh }: Splats, add: (array: ArrayBufferView) => void): void {
  const one = new Float32Array(48);
  for (let i = 0, at = 0; i < count; i += 1) {
    const width = shWidth(shDegrees[i]);
    for (let k = 0; k < width; k += 3) {
      const sign = SH_SIGNS[k / 3];
      for (let c = k; c < k + 3; c += 1) one[c] = sign * sh[at + c];
    }
    add(one.subarray(0, width));
    at += width;
  }
}

function addMaps({ count, rows, cols, texelSizes, shifts }: Splats, add: (array: ArrayBufferView) => void): void {
  const bytes = new ArrayBuffer(16);
  const view = new DataView(bytes);
  for (let i = 0; i < count; i += 1) {
    view.setUint16(0, rows[i], true);
    view.setUint16(2, cols[i], true);
    view.setFloat32(4, texelSizes[2 * i], true);
    view.setFloat32(8, texelSizes[2 * i + 1], true);
    view.setInt16(12, shifts[2 * i], true);
    view.setInt16(14, shifts[2 * i + 1], true);
    add(view);
  }
}
