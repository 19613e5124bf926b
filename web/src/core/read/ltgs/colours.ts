import { EXPONENTS, type Steppers } from './geometry';
import { lengthOf, nearest, signed } from './math';
import type { Steps } from './quantiser';
import type { Block } from './streams';

/** Splats before that predict a colour. */
const BEFORE = 32;

/** Values of len of section 4.3. */
const LENGTHS = 33;

/** Stream 14 of `ltgs.md`, section 4.1: SH of degree 0 with the means of maps, RGB of each splat. */
export function readColours(block: Block, own: Steppers, corners: Float64Array, steps: Steps): Float32Array {
  const { count, classes, factors } = own;
  const luma = block.unsigned(count, classes, EXPONENTS);
  const green = new Uint32Array(count);
  const red = new Uint32Array(count);
  const withLength = (numbers: Uint32Array, i: number): number => LENGTHS * classes[i] + lengthOf(numbers[i]);
  let stream = block.numbers(count, LENGTHS * EXPONENTS, EXPONENTS)!;
  for (let i = 0; i < count; i += 1) green[i] = stream.next(withLength(luma, i), classes[i]);
  stream.end();
  stream = block.numbers(count, LENGTHS * EXPONENTS, LENGTHS * EXPONENTS)!;
  for (let i = 0; i < count; i += 1) red[i] = stream.next(withLength(luma, i), withLength(green, i));
  stream.end();

  const codes = new Float64Array(3 * count);
  const colours = new Float32Array(3 * count);
  const sums = new Float64Array(3);
  for (let i = 0; i < count; i += 1) {
    predict(i, corners, factors, codes, sums);
    codes[3 * i] = (signed(luma[i]) + sums[0]) | 0;
    codes[3 * i + 1] = (signed(green[i]) + sums[1]) | 0;
    codes[3 * i + 2] = (signed(red[i]) + sums[2]) | 0;
    const step = steps.sh0 * factors[i];
    const chroma = step * steps.chroma;
    putColour(colours, 3 * i, codes[3 * i] * step, codes[3 * i + 1] * chroma, codes[3 * i + 2] * chroma, 1);
  }
  return colours;
}

/** The predicted codes of a splat, from those before: the nearest ones count most. */
function predict(i: number, corners: Float64Array, factors: Float64Array, codes: Float64Array, out: Float64Array): void {
  const [x, y, z] = [corners[3 * i], corners[3 * i + 1], corners[3 * i + 2]];
  let luma = 0;
  let green = 0;
  let red = 0;
  let total = 0;
  for (let j = Math.max(i - BEFORE, 0); j < i; j += 1) {
    const dx = corners[3 * j] - x;
    const dy = corners[3 * j + 1] - y;
    const dz = corners[3 * j + 2] - z;
    const near = dx * dx + dy * dy + dz * dz + 1;
    const weight = 1 / (near * near);
    const weighted = weight * factors[j];
    luma += weighted * codes[3 * j];
    green += weighted * codes[3 * j + 1];
    red += weighted * codes[3 * j + 2];
    total += weight;
  }
  out[0] = i === 0 ? 0 : nearest(luma / total / factors[i]);
  out[1] = i === 0 ? 0 : nearest(green / total / factors[i]);
  out[2] = i === 0 ? 0 : nearest(red / total / factors[i]);
}

/** Stores RGB of luma, green and red (section 4.1), with a sign. */
export function putColour(out: Float32Array, at: number, luma: number, green: number, red: number, sign: number): void {
  const other = luma - 0.5 * green;
  out[at] = sign * (other + 0.5 * red);
  out[at + 1] = sign * (luma + 0.5 * green);
  out[at + 2] = sign * (other - 0.5 * red);
}
