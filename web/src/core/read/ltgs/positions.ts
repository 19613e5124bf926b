import { bitsAt } from '../bytes';
import { check } from '../errors';
import { type Steppers, putPosition } from './chunk';
import { clamp, floorLog2, twoTo } from './math';
import type { Quantiser } from './quantiser';
import type { Block } from './streams';

interface Positions {
    readonly positions: Float32Array;
    /** Corners in finest steps, x, y, z of each splat. */
    readonly corners: Float64Array;
}

/** Streams 10 to 12 of `ltgs.md`, section 4.1. */
export function readPositions(block: Block, own: Steppers, scales: Float32Array, { grid, steps }: Quantiser): Positions {
    const { exponents, classes } = own;
    const { reach, bits, cellBits, origin } = grid;
    const count = classes.length;
    const high = block.numbers(count);
    const low = block.numbers(count, classes);
    const lacks = exponents.map((x, i) => clamp(floorLog2(Math.sqrt(scales[2 * i] * scales[2 * i + 1]) / reach) + x, 0, cellBits));
    const placeBits = lacks.reduce((sum, lack) => sum + 3 * (cellBits - lack), 0);
    const places = block.bytes(Math.ceil(placeBits / 8));
    let place = 0;
    const step = steps.position * reach;
    const ofCell = twoTo(cellBits);
    const positions = new Float32Array(3 * count);
    const corners = new Float64Array(3 * count);
    // The Morton number of the cell, and its end: the lowest 31 bits, and those above.
    let [lower, upper] = [0, 0];
    const cells = twoTo(3 * (bits - cellBits));
    const [endLower, endUpper] = [cells % 2 ** 31, Math.floor(cells / 2 ** 31)];
    for (let i = 0; i < count; i += 1) {
        const sum = lower + low[i];
        lower = sum % 2 ** 31;
        upper += high[i] + Math.floor(sum / 2 ** 31);
        const isInside = upper < endUpper || (upper === endUpper && lower < endLower);
        if (!isInside) check(false, 'cell of a splat', upper * 2 ** 31 + lower, `below ${cells}`);
        const edge = twoTo(lacks[i]);
        const ofPlace = cellBits - lacks[i];
        for (let axis = 0; axis < 3; axis += 1) {
            const middle = ((lower >>> 30) | (upper << 1)) & 0x3fffffff;
            const cell = third(lower >>> axis) | (third(middle >>> axis) << 10) | (((upper >>> (29 + axis)) & 1) << 20);
            corners[3 * i + axis] = cell * ofCell + bitsAt(places, place, ofPlace) * edge;
            place += ofPlace;
        }
        const x = origin[0] + (corners[3 * i] + 0.5 * edge) * step;
        const y = origin[1] + (corners[3 * i + 1] + 0.5 * edge) * step;
        const z = origin[2] + (corners[3 * i + 2] + 0.5 * edge) * step;
        putPosition(positions, i, x, y, z);
    }
    check(bitsAt(places, place, 8 * places.length - place) === 0, 'bits behind the places', 1, 0);
    return { positions, corners };
}

/** Bits 0, 3, 6, ... 27 of a number. */
function third(x: number): number {
    x &= 0x09249249;
    x = (x ^ (x >>> 2)) & 0x030c30c3;
    x = (x ^ (x >>> 4)) & 0x0300f00f;
    x = (x ^ (x >>> 8)) & 0x030000ff;
    return (x ^ (x >>> 16)) & 0x3ff;
}
