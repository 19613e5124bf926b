import type { Steppers } from './chunk';
import { lengthOf, nearest, signed } from './math';
import type { Steps } from './quantiser';
import type { Block } from './streams';

/** Splats before that predict a colour. */
const BEFORE = 32;

/** Values of len of `ltgs.md`, section 4.3. */
const LENGTHS = 33;

/** Stream 14 of section 4.1: SH of degree 0 with the means of maps, RGB of each splat. */
export function readColours(block: Block, own: Steppers, corners: Float64Array, steps: Steps): Float32Array {
    const { classes, factors } = own;
    const count = classes.length;
    const withLength = (numbers: Uint32Array): Uint16Array => new Uint16Array(count).map((_, i) => LENGTHS * classes[i] + lengthOf(numbers[i]));
    const luma = block.numbers(count, classes);
    const green = block.numbers(count, withLength(luma), classes);
    const red = block.numbers(count, withLength(luma), withLength(green));
    const channels = [luma, green, red];
    // Codes times 2^x, which is exact.
    const scaled = new Float64Array(3 * count);
    const colours = new Float32Array(3 * count);
    const weights = new Float64Array(BEFORE);
    for (let i = 0; i < count; i += 1) {
        const first = Math.max(i - BEFORE, 0);
        let total = 0;
        for (let j = first; j < i; j += 1) {
            const dx = corners[3 * j] - corners[3 * i];
            const dy = corners[3 * j + 1] - corners[3 * i + 1];
            const dz = corners[3 * j + 2] - corners[3 * i + 2];
            const near = dx * dx + dy * dy + dz * dz + 1;
            const weight = 1 / (near * near);
            weights[j - first] = weight;
            total += weight;
        }
        for (let channel = 0; channel < 3; channel += 1) {
            let sum = 0;
            for (let j = first; j < i; j += 1) sum += weights[j - first] * scaled[3 * j + channel];
            const predicted = i > 0 ? nearest(sum / total / factors[i]) : 0;
            scaled[3 * i + channel] = ((signed(channels[channel][i]) + predicted) | 0) * factors[i];
        }
        const { sh0, chroma } = steps;
        putColour(colours, 3 * i, scaled[3 * i] * sh0, scaled[3 * i + 1] * (sh0 * chroma), scaled[3 * i + 2] * (sh0 * chroma), 1);
    }
    return colours;
}

/** Stores RGB of luma, green and red (section 4.1), with a sign. */
export function putColour(out: Float32Array, at: number, luma: number, green: number, red: number, sign: number): void {
    const other = luma - 0.5 * green;
    out[at] = sign * (other + 0.5 * red);
    out[at + 1] = sign * (luma + 0.5 * green);
    out[at + 2] = sign * (other - 0.5 * red);
}
