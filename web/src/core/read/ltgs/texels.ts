import type { Basis, Texels } from './chunk';
import { putColour } from './colours';
import { LN_2, Y_00, clamp, exp2, lengthOf, signed, twoTo } from './math';
import type { Numbers } from './numbers';
import type { Steps } from './quantiser';
import type { Block } from './streams';

/** Share of each neighbour in the prediction. */
const SHARE = 0.35;

/** Largest absolute exponent of a step of texels. */
const EXPONENT_MAX = 16;

/** Values of each further context (`ltgs.md`, section 4.3). */
const CONTEXTS = 1200;

/** Largest absolute number of a neighbour in a context. */
const SIZE_MAX = 65536;

/** Decodes the texel block of a lossy chunk (section 4.2). */
export function readTexels(block: Block, geometry: Basis, steps: Steps): Texels {
    const { count, rows, cols, texelCount, scales, texelSizes, shifts } = geometry;
    const stream = block.begin(3 * texelCount, CONTEXTS, CONTEXTS);
    const texels = new Float32Array(3 * texelCount);
    const dc = geometry.dc.slice();
    /** Squared distances of rows or columns of a map from the splat's centre, in standard deviations. */
    const squaresOf = (side: number, i: number): Float64Array => {
        const middle = 0.5 * (side - 1 - shifts[i]);
        return new Float64Array(side).map((_, k) => {
            const d = ((k - middle) * texelSizes[i]) / scales[i];
            return d * d;
        });
    };
    for (let i = 0, at = 0; i < count; i += 1) {
        if (rows[i] === 0) continue;
        const squares = [squaresOf(rows[i], 2 * i), squaresOf(cols[i], 2 * i + 1)];
        const own = texels.subarray(at, (at += 3 * rows[i] * cols[i]));
        readMap(stream!, squares[0], squares[1], geometry.steppers!.exponents[i], steps, own);
        const whole = (2 * Math.PI * scales[2 * i] * scales[2 * i + 1]) / (texelSizes[2 * i] * texelSizes[2 * i + 1]);
        meanOf(own, squares[0], squares[1], whole).forEach((mean, c) => {
            dc[3 * i + c] = geometry.dc[3 * i + c] - mean / Y_00;
        });
    }
    stream?.end();
    return { texels, dc };
}

/** Reads the texels of a map, row by row. `exponent`: that of the splat's steps. */
function readMap(
    stream: Numbers,
    ofRows: Float64Array,
    ofCols: Float64Array,
    exponent: number,
    { texel, chroma }: Steps,
    out: Float32Array,
): void {
    const width = 3 * ofCols.length;
    // Values and sizes of numbers of the row above, and of this row to the left: luma, green, red of each column.
    const values = new Float64Array(width);
    const sizes = new Int32Array(width);
    let at = 0;
    for (const ofRow of ofRows) {
        for (let col = 0; col < width; col += 3, at += 3) {
            const q = ofRow + ofCols[col / 3];
            let t = exponent;
            for (let odd = 1; odd < 8 && q > odd * LN_2; odd += 2) t += 1;
            t = clamp(t, -EXPONENT_MAX, EXPONENT_MAX);
            const step = texel * twoTo(t);
            let near = 20 * clamp(t + 8, 0, 19);
            let same = 300 * clamp(t, 0, 3);
            for (let place = col; place < col + 3; place += 1) {
                const value = values[place] + (col > 0 ? values[place - 3] : 0);
                const size = sizes[place] + (col > 0 ? sizes[place - 3] : 0);
                const number = signed(stream.next(near + Math.min(lengthOf(size), 19), same));
                values[place] = SHARE * value + number * (place === col ? step : step * chroma);
                sizes[place] = Math.min(Math.abs(number), SIZE_MAX);
                near += 400;
                same += 100 + (place === col ? 10 : 1) * Math.min(stream.length, 9);
            }
            putColour(out, at, values[col], values[col + 1], values[col + 2], 1);
            for (let c = at; c < at + 3; c += 1) out[c] = clamp(out[c], -1, 1);
        }
    }
}

/** The mean of a map's texels, weighted by the Gaussian. `whole`: what the weights would sum to if the map covered all of it. */
function meanOf(texels: Float32Array, ofRows: Float64Array, ofCols: Float64Array, whole: number): number[] {
    const weight = (square: number): number => exp2((-0.5 * square) / LN_2);
    const weights = ofCols.map(weight);
    const sum = [0, 0, 0];
    let total = 0;
    let at = 0;
    for (const ofRow of ofRows.map(weight)) {
        for (const ofCol of weights) {
            total += ofRow * ofCol;
            for (let c = 0; c < 3; c += 1, at += 1) sum[c] += ofRow * ofCol * texels[at];
        }
    }
    const divisor = Math.max(total, whole);
    return divisor > 0 && divisor < Infinity ? sum.map((s) => s / divisor) : sum.fill(0);
}
