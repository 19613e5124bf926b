import type { Geometry, Texels } from './chunk';
import { putColour } from './colours';
import { LN_2, Y_00, clamp, exp2, lengthOf, signed, twoTo } from './math';
import type { Numbers } from './numbers';
import type { Steps } from './quantiser';
import { Block } from './streams';

/** Share of each neighbour in the prediction. */
const SHARE = 0.35;

/** Largest exponent of a step of texels. */
const EXPONENT_MAX = 16;

/** Values of both further contexts (`ltgs.md`, section 4.3). */
const CONTEXTS = 1200;

/** Largest absolute number of a neighbour in a context. */
const SIZE_MAX = 65536;

/** Decodes the texel block of a lossy chunk (section 4.2). */
export function readTexels(data: Uint8Array, geometry: Geometry, steps: Steps): Texels {
  const { count, rows, cols, dc } = geometry;
  const block = new Block(data);
  const stream = block.numbers(3 * geometry.texels, CONTEXTS, CONTEXTS);
  const texels = new Float32Array(3 * geometry.texels);
  const exact = dc.slice();
  if (stream !== null) {
    const maps = new Maps(stream, geometry, steps);
    for (let i = 0, at = 0; i < count; i += 1) {
      if (rows[i] === 0) continue;
      const end = at + 3 * rows[i] * cols[i];
      const own = texels.subarray(at, end);
      maps.read(i, own);
      const mean = maps.mean(i, own);
      for (let c = 0; c < 3; c += 1) exact[3 * i + c] = dc[3 * i + c] - mean[c] / Y_00;
      at = end;
    }
    stream.end();
  }
  block.end();
  return { texels, dc: exact };
}

/** Reads maps one after the other. */
class Maps {
  /** Squared distances of rows and columns from the splat's centre, in standard deviations. */
  private readonly squares = [new Float64Array(0), new Float64Array(0)];
  /** Values and sizes of numbers of the row above: luma, green, red of each column, and a texel outside the map. */
  private values = new Float64Array(0);
  private sizes = new Int32Array(0);
  /** Steps of luma by exponent from -16. */
  private readonly lumaSteps: Float64Array;

  constructor(
    private readonly stream: Numbers,
    private readonly geometry: Geometry,
    private readonly steps: Steps,
  ) {
    this.lumaSteps = Float64Array.from({ length: 2 * EXPONENT_MAX + 1 }, (_, i) => steps.texel * twoTo(i - EXPONENT_MAX));
  }

  /** Reads the texels of the map of splat `i`, row by row. */
  read(i: number, out: Float32Array): void {
    const { geometry, stream, lumaSteps } = this;
    const rows = geometry.rows[i];
    const cols = geometry.cols[i];
    this.measure(i, 0, rows);
    this.measure(i, 1, cols);
    if (this.values.length < 3 * cols) {
      this.values = new Float64Array(3 * cols);
      this.sizes = new Int32Array(3 * cols);
    }
    const { values, sizes } = this;
    const [squaresU, squaresV] = this.squares;
    values.fill(0, 0, 3 * cols);
    sizes.fill(0, 0, 3 * cols);
    const x = geometry.exponents[i];
    const { chroma } = this.steps;
    for (let row = 0, at = 0; row < rows; row += 1) {
      for (let col = 0; col < 3 * cols; col += 3, at += 3) {
        const q = squaresU[row] + squaresV[col / 3];
        const falloff = (q > LN_2 ? 1 : 0) + (q > 3 * LN_2 ? 1 : 0) + (q > 5 * LN_2 ? 1 : 0) + (q > 7 * LN_2 ? 1 : 0);
        const t = clamp(x + falloff, -EXPONENT_MAX, EXPONENT_MAX);
        const step = lumaSteps[t + EXPONENT_MAX];
        const near = 20 * clamp(t + 8, 0, 19);
        let same = 300 * clamp(t, 0, 3);
        for (let channel = 0; channel < 3; channel += 1) {
          const place = col + channel;
          let value = values[place];
          let size = sizes[place];
          if (col > 0) {
            value += values[place - 3];
            size += sizes[place - 3];
          }
          const number = signed(stream.next(400 * channel + near + Math.min(lengthOf(size), 19), same));
          same += 100 + (channel === 0 ? 10 : channel === 1 ? 1 : 0) * Math.min(stream.length, 9);
          values[place] = SHARE * value + number * (channel === 0 ? step : step * chroma);
          sizes[place] = Math.min(Math.abs(number), SIZE_MAX);
        }
        putColour(out, at, values[col], values[col + 1], values[col + 2], 1);
        for (let c = at; c < at + 3; c += 1) out[c] = clamp(out[c], -1, 1);
      }
    }
  }

  /** The mean of the map that was read last, that of splat `i`. */
  mean(i: number, texels: Float32Array): number[] {
    const { scales, texelSizes, rows, cols } = this.geometry;
    const [ofRows, ofCols] = [rows, cols].map((sides, axis) =>
      this.squares[axis].subarray(0, sides[i]).map((square) => exp2((-0.5 * square) / LN_2)),
    );
    const sum = [0, 0, 0];
    let total = 0;
    let at = 0;
    for (const ofRow of ofRows) {
      for (const ofCol of ofCols) {
        const weight = ofRow * ofCol;
        total += weight;
        for (let c = 0; c < 3; c += 1, at += 1) sum[c] += weight * texels[at];
      }
    }
    const whole = (2 * Math.PI * scales[2 * i] * scales[2 * i + 1]) / (texelSizes[2 * i] * texelSizes[2 * i + 1]);
    const divisor = whole > total ? whole : total;
    return divisor > 0 && divisor < Infinity ? sum.map((s) => s / divisor) : [0, 0, 0];
  }

  private measure(i: number, axis: 0 | 1, side: number): void {
    const { scales, texelSizes, shifts } = this.geometry;
    if (this.squares[axis].length < side) this.squares[axis] = new Float64Array(side);
    const squares = this.squares[axis];
    const middle = 0.5 * (side - 1 - shifts[2 * i + axis]);
    for (let k = 0; k < side; k += 1) {
      const d = ((k - middle) * texelSizes[2 * i + axis]) / scales[2 * i + axis];
      squares[k] = d * d;
    }
  }
}
