import { SH_SIGNS } from '../splats';
import { type ChunkDecoder, putPosition, putRotation, roomForSh, withDegree } from './chunk';
import { readDegrees, readShifts, texelsOf } from './maps';
import { Y_00 } from './math';
import type { Block } from './streams';

/** The bytes of numbers of `size` bytes that stand in planes of `width` components (`ltgs.md`, section 3). */
function planes(block: Block, count: number, width: number, size: number): ArrayBuffer {
    const out = new Uint8Array(count * width * size);
    for (let byte = 0; byte < size; byte += 1) {
        const plane = block.bytes(count * width);
        for (let component = 0, from = 0; component < width; component += 1) {
            for (let i = 0; i < count; i += 1, from += 1) out[(i * width + component) * size + byte] = plane[from];
        }
    }
    return out.buffer;
}

const floats = (block: Block, count: number, width: number): Float32Array => new Float32Array(planes(block, count, width, 4));

/** Decodes the chunks of a lossless file of an SH degree. */
export function lossless(fileDegree: number): ChunkDecoder {
    return {
        geometry(block, count) {
            const [rows, cols] = [0, 1].map(() => new Uint16Array(planes(block, count, 1, 2)));
            const [sizes, changes] = [0, 1].map(() => new Uint32Array(planes(block, count, 1, 4)));
            const both = Uint32Array.from({ length: 2 * count }, (_, i) => sizes[i >> 1] ^ (i & 1 ? changes[i >> 1] : 0));
            const texelCount = texelsOf(rows, cols);
            const shifts = readShifts(block, rows, cols, false);
            const positions = floats(block, count, 3);
            const rotations = floats(block, count, 4);
            for (let i = 0; i < count; i += 1) {
                putPosition(positions, i, positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]);
                putRotation(rotations, i, rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]);
            }
            const scales = floats(block, count, 2);
            const opacities = floats(block, count, 1);
            const dc = floats(block, count, 3);
            const dcShown = dc.slice();
            for (let channel = 0; channel < 3; channel += 1) {
                block.signed(count).forEach((mean, i) => {
                    if (rows[i] > 0) dcShown[3 * i + channel] += mean / 255 / Y_00;
                });
            }
            const texelSizes = new Float32Array(both.buffer);
            return { count, positions, rotations, scales, opacities, dc, dcShown, rows, cols, texelSizes, shifts, texelCount };
        },

        sh(block, { count }) {
            const out = roomForSh(readDegrees(block, count, fileDegree));
            for (let degree = 1; degree <= fileDegree; degree += 1) {
                const { places } = withDegree(out.degrees, degree);
                const width = 3 * (2 * degree + 1);
                const values = floats(block, places.length, width);
                places.forEach((place, i) => {
                    for (let k = 0; k < width; k += 1) {
                        out.sh[place + k] = SH_SIGNS[degree * degree + Math.floor(k / 3)] * values[width * i + k];
                    }
                });
            }
            return out;
        },

        texels: (block, { texelCount, dc }) => ({ texels: floats(block, texelCount, 3), dc }),
    };
}
