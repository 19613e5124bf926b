import { invalid } from '../errors';
import type { Geometry } from './chunk';
import { putRotation } from './chunk';
import { readColours } from './colours';
import { SIDE_MAX, readShifts, texelsOf } from './maps';
import { F32_MAX, F32_MIN, clamp, exp2, floorLog2, log256, nearest, twoTo } from './math';
import { readPositions } from './positions';
import type { Quantiser } from './quantiser';
import { Block } from './streams';

/** Largest absolute exponent of a splat's steps, and how many values that makes. */
export const EXPONENT_MAX = 8;
export const EXPONENTS = 17;

/** Splats before that predict a standard deviation. */
const SCALES_BEFORE = 8;

/** What the streams of a geometry block need of those before. */
export interface Steppers {
  readonly count: number;
  /** Exponents x of the steps, x + 8, and 2^x. */
  readonly exponents: Int32Array;
  readonly classes: Uint8Array;
  readonly factors: Float64Array;
}

/** Decodes the geometry block of a lossy chunk (`ltgs.md`, section 4.1). */
export function readGeometry(data: Uint8Array, count: number, quantiser: Quantiser): Geometry {
  const block = new Block(data);
  const exponents = block.signed(count);
  for (const x of exponents) if (Math.abs(x) > EXPONENT_MAX) throw invalid(`exponent ${x} of a splat, expected -${EXPONENT_MAX} to ${EXPONENT_MAX}`);
  const own: Steppers = {
    count,
    exponents,
    classes: Uint8Array.from(exponents, (x) => x + EXPONENT_MAX),
    factors: Float64Array.from(exponents, twoTo),
  };
  const { rows, cols } = readSides(block, own);
  const texels = texelsOf(rows, cols);
  const { logs, octaves, scales } = readScales(block, own, rows, cols, quantiser);
  const { texelSizes, shifts } = readMaps(block, rows, cols, logs, quantiser);
  const rotations = readRotations(block, own, rows, scales, quantiser);
  const { positions, corners } = readPositions(block, own, scales, quantiser.grid, quantiser.steps.position);
  const opacities = readOpacities(block, own, octaves, quantiser);
  const dc = readColours(block, own, corners, quantiser.steps);
  block.end();
  return { count, positions, rotations, scales, opacities, dc, dcShown: dc, rows, cols, texelSizes, shifts, texels, exponents };
}

/** Streams 2 and 3. */
function readSides(block: Block, { count, classes }: Steppers): { rows: Uint16Array; cols: Uint16Array } {
  const found = block.unsigned(count, classes, EXPONENTS);
  const textured = [...found.keys()].filter((i) => found[i] > 0);
  const side = (value: number): number => {
    if (value < 0 || value > SIDE_MAX) throw invalid(`a map with a side of ${value} texels, expected at most ${SIDE_MAX}`);
    return value;
  };
  const rows = Uint16Array.from(found, side);
  const cols = new Uint16Array(count);
  const contexts = textured.map((i) => Math.min(rows[i], 12));
  block.signed(textured.length, contexts, 13).forEach((more, k) => {
    cols[textured[k]] = side((rows[textured[k]] + more) | 0);
  });
  return { rows, cols };
}

/** Contexts of streams that depend on both sides of a map. */
function sidesContexts(rows: Uint16Array, cols: Uint16Array): Uint8Array {
  return Uint8Array.from(rows, (count, i) => 7 * Math.min(count, 6) + Math.min(cols[i], 6));
}

interface Scales {
  /** log2 of the standard deviations along u and v. */
  readonly logs: Float64Array;
  /** code * s along u. */
  readonly octaves: Float64Array;
  readonly scales: Float32Array;
}

/** Streams 4 and 5. */
function readScales(block: Block, own: Steppers, rows: Uint16Array, cols: Uint16Array, { steps, grid }: Quantiser): Scales {
  const { count, classes, factors } = own;
  const rests = block.signed(count, classes, EXPONENTS);
  const less = new Uint32Array(count);
  const stream = block.numbers(count, EXPONENTS, 49)!;
  const sides = sidesContexts(rows, cols);
  for (let i = 0; i < count; i += 1) less[i] = stream.next(classes[i], sides[i]);
  stream.end();
  const logs = new Float64Array(2 * count);
  const octaves = new Float64Array(count);
  const scales = new Float32Array(2 * count);
  for (let i = 0; i < count; i += 1) {
    const step = Math.min(steps.log2Scale * factors[i], 1);
    const first = Math.max(i - SCALES_BEFORE, 0);
    let sum = 0;
    for (let j = first; j < i; j += 1) sum += octaves[j];
    const predicted = i === 0 ? 0 : nearest(sum / (i - first) / step);
    const code = (rests[i] + predicted) | 0;
    octaves[i] = code * step;
    logs[2 * i] = grid.log2Scale + octaves[i];
    logs[2 * i + 1] = grid.log2Scale + ((code - less[i]) | 0) * step;
    for (let axis = 2 * i; axis < 2 * i + 2; axis += 1) scales[axis] = clamp(Math.fround(exp2(logs[axis])), F32_MIN, 1e6);
  }
  return { logs, octaves, scales };
}

/** Stream 6: texel sizes and shifts. */
function readMaps(block: Block, rows: Uint16Array, cols: Uint16Array, logs: Float64Array, { steps, grid }: Quantiser): { texelSizes: Float32Array; shifts: Int16Array } {
  const textured = [...rows.keys()].filter((i) => rows[i] > 0);
  const sides = sidesContexts(rows, cols);
  const contexts = textured.map((i) => sides[i]);
  const means = block.signed(textured.length, contexts, 49);
  const octaves = block.signed(textured.length, contexts, 49, true);
  const rests = block.signed(textured.length, undefined, 0, true);
  const shifts = readShifts(block, rows, cols, true);
  const texelSizes = new Float32Array(2 * rows.length);
  textured.forEach((i, k) => {
    const step = steps.log2TexelSize * twoTo(-floorLog2(Math.max(rows[i], cols[i])));
    const expected = 0.5 * (logs[2 * i] + logs[2 * i + 1] - log256(rows[i] * cols[i]) / 256) + grid.log2TexelSize;
    const half = 0.5 * (octaves[k] + rests[k] * step);
    const mean = expected + means[k] * step;
    texelSizes[2 * i] = clamp(Math.fround(exp2(mean - half)), F32_MIN, F32_MAX);
    texelSizes[2 * i + 1] = clamp(Math.fround(exp2(mean + half)), F32_MIN, F32_MAX);
  });
  return { texelSizes, shifts };
}

/** Streams 7 to 9. */
function readRotations(block: Block, own: Steppers, rows: Uint16Array, scales: Float32Array, { steps }: Quantiser): Float32Array {
  const { count, classes, factors } = own;
  const swings = [0, 1].map(() => block.signed(count, classes, EXPONENTS));
  const twistSteps = Float64Array.from(factors, (factor, i) => {
    const u = scales[2 * i];
    const v = scales[2 * i + 1];
    const anisotropy = clamp(Math.abs(u / v - v / u), rows[i] > 0 ? 0.375 : 0.0625, 4096);
    return Math.min((steps.twist * factor) / anisotropy, 0.25);
  });
  const contexts = Uint8Array.from(twistSteps, (step) => clamp(Math.floor(-log256(step) / 64), 0, 127));
  const twists = block.signed(count, contexts, 128);
  const rotations = new Float32Array(4 * count);
  for (let i = 0; i < count; i += 1) {
    const swingStep = Math.min(steps.tilt * factors[i], 0.25);
    let p = swings[0][i] * swingStep;
    let q = swings[1][i] * swingStep;
    const squares = p * p + q * q;
    if (squares > 1) {
      const length = Math.sqrt(squares);
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
function readOpacities(block: Block, { count, classes, factors }: Steppers, octaves: Float64Array, { steps }: Quantiser): Float32Array {
  const contexts = Uint16Array.from(classes, (x, i) => 40 * x + 20 + clamp(Math.floor(octaves[i]), -20, 19));
  const codes = block.unsigned(count, contexts, 40 * EXPONENTS);
  return Float32Array.from(codes, (code, i) => clamp(Math.fround(exp2(-(code * Math.min(steps.log2Opacity * factors[i], 1)))), F32_MIN, 1));
}
