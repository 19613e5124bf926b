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
    const add = (array: ArrayBufferView): void => {
        hasher.update(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
    };
    /** Adds numbers that `put` writes, at most `width` a splat; it returns the place behind them. */
    const turned = (width: number, put: (part: Splats, i: number, out: Float32Array, at: number) => number): void => {
        const piece = new Float32Array(PIECE * width);
        for (const part of parts) {
            for (let i = 0; i < part.count; ) {
                let end = 0;
                for (const stop = Math.min(i + PIECE, part.count); i < stop; i += 1) end = put(part, i, piece, end);
                add(piece.subarray(0, end));
            }
        }
    };
    add(Uint32Array.of(parts.reduce((sum, part) => sum + part.count, 0), info.filter === 'ewa' ? 1 : 0));
    add(Float32Array.of(info.near));
    turned(3, ({ positions }, i, out, at) => {
        out[at] = positions[3 * i];
        out[at + 1] = -positions[3 * i + 1];
        out[at + 2] = -positions[3 * i + 2];
        return at + 3;
    });
    turned(4, ({ rotations }, i, out, at) => {
        // wxyz with y down from xyzw with y up.
        out[at] = rotations[4 * i];
        out[at + 1] = -rotations[4 * i + 3];
        out[at + 2] = rotations[4 * i + 2];
        out[at + 3] = -rotations[4 * i + 1];
        return at + 4;
    });
    for (const name of ['scales', 'opacities', 'shDegrees'] as const) for (const part of parts) add(part[name]);
    let from = 0;
    turned(48, ({ shDegrees, sh }, i, out, at) => {
        if (i === 0) from = 0;
        for (const end = at + shWidth(shDegrees[i]), first = at; at < end; at += 1, from += 1) {
            out[at] = SH_SIGNS[Math.floor((at - first) / 3)] * sh[from];
        }
        return at;
    });
    const map = new DataView(new ArrayBuffer(16));
    for (const { count, rows, cols, texelSizes, shifts } of parts) {
        for (let i = 0; i < count; i += 1) {
            map.setUint16(0, rows[i], true);
            map.setUint16(2, cols[i], true);
            for (let axis = 0; axis < 2; axis += 1) {
                map.setFloat32(4 + 4 * axis, texelSizes[2 * i + axis], true);
                map.setInt16(12 + 2 * axis, shifts[2 * i + axis], true);
            }
            add(map);
        }
    }
    for (const part of parts) add(part.texels);
    return hasher.hex();
}
