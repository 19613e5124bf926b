import { invalid } from '../errors';
import { SH_SIGNS, shWidth } from '../splats';
import { type ChunkDecoder, type Geometry, type Sh, type Texels, putPosition, putRotation, roomForSh } from './chunk';
import { readDegrees, readShifts, texelsOf } from './maps';
import { Y_00 } from './math';
import { Block } from './streams';

/** The bytes of numbers that stand in planes of `width` components (`ltgs.md`, section 3). */
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

/** Decodes the chunks of a lossless file. */
export class Lossless implements ChunkDecoder {
  constructor(private readonly degree: number) {}

  geometry(data: Uint8Array, count: number): Geometry {
    const block = new Block(data);
    const rows = new Uint16Array(planes(block, count, 1, 2));
    const cols = new Uint16Array(planes(block, count, 1, 2));
    const sizesU = new Uint32Array(planes(block, count, 1, 4));
    const changes = new Uint32Array(planes(block, count, 1, 4));
    const sizes = Uint32Array.from({ length: 2 * count }, (_, i) => (i % 2 === 0 ? sizesU[i >> 1] : sizesU[i >> 1] ^ changes[i >> 1]));
    const texels = texelsOf(rows, cols);
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
    block.end();
    const texelSizes = new Float32Array(sizes.buffer);
    return { count, positions, rotations, scales, opacities, dc, dcShown, rows, cols, texelSizes, shifts, texels, exponents: new Int32Array(0) };
  }

  sh(data: Uint8Array, { count }: Geometry): Sh {
    const block = new Block(data);
    if (this.degree === 0) {
      block.end();
      return roomForSh(new Uint8Array(count));
    }
    const out = roomForSh(readDegrees(block, count, this.degree));
    for (let degree = 1; degree <= this.degree; degree += 1) {
      const own = out.degrees.reduce((sum, d) => sum + (d >= degree ? 1 : 0), 0);
      const coefficients = 2 * degree + 1;
      const values = floats(block, own, 3 * coefficients);
      for (let i = 0, at = 0, from = 0; i < count; i += 1) {
        if (out.degrees[i] >= degree) {
          for (let k = 0; k < 3 * coefficients; k += 1, from += 1) {
            out.sh[at + shWidth(degree - 1) + k] = SH_SIGNS[degree * degree + Math.floor(k / 3)] * values[from];
          }
        }
        at += shWidth(out.degrees[i]);
      }
    }
    block.end();
    return out;
  }

  texels(data: Uint8Array, geometry: Geometry): Texels {
    const block = new Block(data);
    const texels = floats(block, geometry.texels, 3);
    block.end();
    for (const texel of texels) if (!(Math.abs(texel) <= 1)) throw invalid(`texel ${texel}, expected -1 to 1`);
    return { texels, dc: geometry.dc };
  }
}
