import { check } from '../errors';
import { type Geometry, type Steppers, putRotation } from './chunk';
import { readColours } from './colours';
import { SIDE_MAX, readShifts, texelsOf, texturedOf } from './maps';
import { F32_MAX, F32_MIN, clamp, exp2, floorLog2, log256, nearest, twoTo } from './math';
import { readPositions } from './positions';
import type { Quantiser } from './quantiser';
import type { Block } from './streams';

/** Largest absolute exponent of a splat's steps. */
const EXPONENT_MAX = 8;

/** Splats before that predict a standard deviation. */
const SCALES_BEFORE = 8;

/** Decodes the geometry block of a lossy chunk (`ltgs.md`, section 4.1). */
export function readGeometry(block: Block, count: number, quantiser: Quantiser): Geometry {
    const exponents = block.signed(count);
    for (const x of exponents) check(Math.abs(x) <= EXPONENT_MAX, 'exponent of a splat', x, '-8 to 8');
    const steppers: Steppers = {
        exponents,
        classes: new Uint8Array(count).map((_, i) => exponents[i] + EXPONENT_MAX),
        factors: new Float64Array(count).map((_, i) => twoTo(exponents[i])),
    };
    const { rows, cols } = readSides(block, steppers);
    const texelCount = texelsOf(rows, cols);
    const sides = new Uint8Array(count).map((_, i) => 7 * Math.min(rows[i], 6) + Math.min(cols[i], 6));
    const { logs, octaves, scales } = readScales(block, steppers, sides, quantiser);
    const texelSizes = readTexelSizes(block, rows, cols, sides, logs, quantiser);
    const shifts = readShifts(block, rows, cols, true);
    const rotations = readRotations(block, steppers, rows, scales, quantiser);
    const { positions, corners } = readPositions(block, steppers, scales, quantiser);
    const opacities = readOpacities(block, steppers, octaves, quantiser);
    const dc = readColours(block, steppers, corners, quantiser.steps);
    return {
        count, positions, rotations, scales, opacities, dc, dcShown: dc, rows, cols, texelSizes, shifts, texelCount, steppers,
    };
}

/** Streams 2 and 3. */
function readSides(block: Block, { classes }: Steppers): { readonly rows: Uint16Array; readonly cols: Uint16Array } {
    const side = (texels: number): number => {
        check(texels >= 0 && texels <= SIDE_MAX, 'side of a map', texels, `1 to ${SIDE_MAX}`);
        return texels;
    };
    const rows = new Uint16Array(block.numbers(classes.length, classes).map(side));
    const cols = new Uint16Array(rows.length);
    const textured = texturedOf(rows);
    const contexts = Uint8Array.from(textured, (i) => Math.min(rows[i], 12));
    block.signed(textured.length, contexts).forEach((more, k) => {
        cols[textured[k]] = side((rows[textured[k]] + more) | 0);
    });
    return { rows, cols };
}

interface Scales {
    /** log2 of the standard deviations along u and v. */
    readonly logs: Float64Array;
    /** code * s along u. */
    readonly octaves: Float64Array;
    readonly scales: Float32Array;
}

/** Streams 4 and 5. */
function readScales(block: Block, { classes, factors }: Steppers, sides: Uint8Array, { steps, grid }: Quantiser): Scales {
    const count = classes.length;
    const rests = block.signed(count, classes);
    const less = block.numbers(count, classes, sides);
    const octaves = new Float64Array(count);
    const logs = new Float64Array(2 * count);
    for (let i = 0; i < count; i += 1) {
        const step = Math.min(steps.log2Scale * factors[i], 1);
        const first = Math.max(i - SCALES_BEFORE, 0);
        let sum = 0;
        for (let j = first; j < i; j += 1) sum += octaves[j];
        const code = (rests[i] + (i > 0 ? nearest(sum / (i - first) / step) : 0)) | 0;
        octaves[i] = code * step;
        logs[2 * i] = grid.log2Scale + octaves[i];
        logs[2 * i + 1] = grid.log2Scale + ((code - less[i]) | 0) * step;
    }
    return { logs, octaves, scales: new Float32Array(logs.length).map((_, k) => clamp(Math.fround(exp2(logs[k])), F32_MIN, 1e6)) };
}

/** The first three streams of 6. */
function readTexelSizes(
    block: Block,
    rows: Uint16Array,
    cols: Uint16Array,
    sides: Uint8Array,
    logs: Float64Array,
    { steps, grid }: Quantiser,
): Float32Array {
    const textured = texturedOf(rows);
    const contexts = Uint8Array.from(textured, (i) => sides[i]);
    const means = block.signed(textured.length, contexts);
    const octaves = block.signed(textured.length, contexts, true);
    const rests = block.signed(textured.length, undefined, true);
    const texelSizes = new Float32Array(2 * rows.length);
    textured.forEach((i, k) => {
        const step = steps.log2TexelSize * twoTo(-floorLog2(Math.max(rows[i], cols[i])));
        const expected = 0.5 * (logs[2 * i] + logs[2 * i + 1] - log256(rows[i] * cols[i]) / 256) + grid.log2TexelSize;
        const half = 0.5 * (octaves[k] + rests[k] * step);
        const mean = expected + means[k] * step;
        texelSizes[2 * i] = clamp(Math.fround(exp2(mean - half)), F32_MIN, F32_MAX);
        texelSizes[2 * i + 1] = clamp(Math.fround(exp2(mean + half)), F32_MIN, F32_MAX);
    });
    return texelSizes;
}

/** Streams 7 to 9. */
function readRotations(block: Block, own: Steppers, rows: Uint16Array, scales: Float32Array, { steps }: Quantiser): Float32Array {
    const { classes, factors } = own;
    const count = classes.length;
    const [swingsX, swingsY] = [0, 1].map(() => block.signed(count, classes));
    const twistSteps = factors.map((factor, i) => {
        const u = scales[2 * i];
        const v = scales[2 * i + 1];
        const anisotropy = clamp(Math.abs(u / v - v / u), rows[i] > 0 ? 0.375 : 0.0625, 4096);
        return Math.min((steps.twist * factor) / anisotropy, 0.25);
    });
    const twists = block.signed(count, new Uint8Array(count).map((_, i) => clamp(Math.floor(-log256(twistSteps[i]) / 64), 0, 127)));
    const rotations = new Float32Array(4 * count);
    for (let i = 0; i < count; i += 1) {
        const step = Math.min(steps.tilt * factors[i], 0.25);
        let p = swingsX[i] * step;
        let q = swingsY[i] * step;
        const length = Math.sqrt(p * p + q * q);
        if (p * p + q * q > 1) {
            p /= length;
            q /= length;
        }
        const s = clamp(twists[i] * twistSteps[i], -1, 1);
        const w = Math.sqrt(Math.max(1 - (p * p + q * q), 0));
        const c = Math.sqrt(Math.max(1 - s * s, 0));
        putRotation(rotations, i, w * c, p * c + q * s, q * c - p * s, w * s);
    }
    return rotations;
}

/** Stream 13. */
function readOpacities(block: Block, { classes, factors }: Steppers, octaves: Float64Array, { steps }: Quantiser): Float32Array {
    const contexts = new Uint16Array(classes.length).map((_, i) => 40 * classes[i] + 20 + clamp(Math.floor(octaves[i]), -20, 19));
    const codes = block.numbers(classes.length, contexts);
    return new Float32Array(codes.length).map((_, i) => clamp(Math.fround(exp2(-(codes[i] * Math.min(steps.log2Opacity * factors[i], 1)))), F32_MIN, 1));
}
