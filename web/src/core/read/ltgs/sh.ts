import { SH_SIGNS, shWidth } from '../splats';
import { type Geometry, type Sh, roomForSh } from './chunk';
import { putColour } from './colours';
import { EXPONENTS, EXPONENT_MAX } from './geometry';
import { readDegrees } from './maps';
import { signed, twoTo } from './math';
import type { Steps } from './quantiser';
import { Block } from './streams';

/** Classes of the mean length of a splat's lower coefficients, and of the lengths of the channels before. */
const MEANS = 20;
const CHANNELS = 100;

/** Decodes the SH block of a lossy chunk (`ltgs.md`, sections 4.1 and 4.3). */
export function readSh(data: Uint8Array, geometry: Geometry, fileDegree: number, steps: Steps): Sh {
  const { count, exponents } = geometry;
  const block = new Block(data);
  if (fileDegree === 0) {
    block.end();
    return roomForSh(new Uint8Array(count));
  }
  const classes = Uint8Array.from(exponents, (x) => x + EXPONENT_MAX);
  const out = roomForSh(readDegrees(block, count, fileDegree, classes));
  const places = new Uint32Array(count);
  for (let i = 1; i < count; i += 1) places[i] = places[i - 1] + shWidth(out.degrees[i - 1]);
  // t of section 4.3 by channel and splat.
  const sums = [0, 1, 2].map(() => new Uint32Array(count));
  for (let degree = 1; degree <= fileDegree; degree += 1) {
    const own = indices(out.degrees, degree);
    const size = own.length * (2 * degree + 1);
    const codes = [0, 1, 2].map(() => new Int32Array(size));
    // 10 Y + G.
    const known = new Uint8Array(size);
    for (let channel = 0; channel < 3; channel += 1) {
      const stream = block.numbers(size, MEANS * EXPONENTS, CHANNELS);
      if (stream === null) continue;
      const weight = [10, 1, 0][channel];
      const lengths = sums[channel];
      for (let k = degree * degree, at = 0; k < (degree + 1) * (degree + 1); k += 1) {
        for (const i of own) {
          const mean = k > 1 ? Math.min(MEANS - 1, Math.floor((2 * lengths[i]) / (k - 1))) : 0;
          const number = stream.next(MEANS * classes[i] + mean, known[at]);
          lengths[i] += stream.length;
          known[at] += weight * Math.min(stream.length, 9);
          codes[channel][at] = signed(number);
          at += 1;
        }
      }
      stream.end();
    }
    for (let k = degree * degree, at = 0; k < (degree + 1) * (degree + 1); k += 1) {
      for (const i of own) {
        const step = steps.shRest[degree - 1] * twoTo(exponents[i]);
        const chroma = step * steps.chroma;
        putColour(out.sh, places[i] + 3 * k, codes[0][at] * step, codes[1][at] * chroma, codes[2][at] * chroma, SH_SIGNS[k]);
        at += 1;
      }
    }
  }
  block.end();
  return out;
}

/** Splats that have a degree. */
function indices(degrees: Uint8Array, least: number): number[] {
  return [...degrees.keys()].filter((i) => degrees[i] >= least);
}
