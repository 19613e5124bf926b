import { invalid } from '../errors';
import { putPosition } from './chunk';
import { EXPONENTS, type Steppers } from './geometry';
import { clamp, floorLog2, twoTo } from './math';
import type { Grid } from './quantiser';
import type { Block } from './streams';

interface Positions {
  readonly positions: Float32Array;
  /** Corners in finest steps, x, y, z of each splat. */
  readonly corners: Float64Array;
}

/** Streams 10 to 12 of `ltgs.md`, section 4.1. */
export function readPositions(block: Block, { count, exponents, classes }: Steppers, scales: Float32Array, grid: Grid, share: number): Positions {
  const { reach, bits, cellBits, origin } = grid;
  const high = block.unsigned(count);
  const low = block.unsigned(count, classes, EXPONENTS);
  const lacks = Uint8Array.from(exponents, (x, i) => clamp(floorLog2(Math.sqrt(scales[2 * i] * scales[2 * i + 1]) / reach) + x, 0, cellBits));
  const placeBits = lacks.reduce((sum, lack) => sum + 3 * (cellBits - lack), 0);
  const places = new Bits(block.bytes(Math.ceil(placeBits / 8)));
  const positions = new Float32Array(3 * count);
  const corners = new Float64Array(3 * count);
  const cells = twoTo(3 * (bits - cellBits));
  const cellsUpper = Math.floor(cells / 2 ** 31);
  const step = share * reach;
  const centre = [0, 0, 0];
  // The Morton number of the cell: its lowest 31 bits, and those above.
  let lower = 0;
  let upper = 0;
  for (let i = 0; i < count; i += 1) {
    const sum = lower + low[i];
    lower = sum % 2 ** 31;
    upper += high[i] + Math.floor(sum / 2 ** 31);
    if (upper > cellsUpper || (upper === cellsUpper && lower >= cells % 2 ** 31)) throw invalid(`splat ${i}: its cell lies outside the grid`);
    const [a, b, c] = [lower & 0x3fffffff, (lower >>> 30) | (upper << 1), Math.floor(upper / 2 ** 29)];
    const edge = twoTo(lacks[i]);
    for (let axis = 0; axis < 3; axis += 1) {
      const cell = third(a >>> axis) | (third((b & 0x3fffffff) >>> axis) << 10) | (((c >>> axis) & 1) << 20);
      const corner = cell * twoTo(cellBits) + places.take(cellBits - lacks[i]) * edge;
      corners[3 * i + axis] = corner;
      centre[axis] = origin[axis] + (corner + 0.5 * edge) * step;
    }
    putPosition(positions, i, centre[0], centre[1], centre[2]);
  }
  places.end();
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

/** Numbers of some bits each, the lowest bit first. */
class Bits {
  private at = 0;
  private rest = 0;
  private left = 0;

  constructor(private readonly bytes: Uint8Array) {}

  take(count: number): number {
    let value = 0;
    for (let known = 0; known < count; ) {
      if (this.left === 0) {
        this.rest = this.bytes[this.at];
        this.left = 8;
        this.at += 1;
      }
      const part = Math.min(count - known, this.left);
      value += (this.rest & ((1 << part) - 1)) * 2 ** known;
      this.rest >>= part;
      this.left -= part;
      known += part;
    }
    return value;
  }

  end(): void {
    if (this.rest !== 0) throw invalid('positions: bits behind the last place');
  }
}
