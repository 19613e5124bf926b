import { invalid } from '../errors';
import type { Block } from './streams';

/** Largest side of a map, texels. */
export const SIDE_MAX = 4096;

/** Sides from which they are not told apart as contexts of shifts (`ltgs.md`, section 4.3). */
const SIDE_CONTEXTS = 13;

/** Texels of maps with these sides, which are checked (section 2). */
export function texelsOf(rows: Uint16Array, cols: Uint16Array): number {
  let texels = 0;
  rows.forEach((count, i) => {
    if (count > 0 !== cols[i] > 0 || count > SIDE_MAX || cols[i] > SIDE_MAX) {
      throw invalid(`splat ${i}: a map of ${count} x ${cols[i]} texels, expected sides of 1 to ${SIDE_MAX}`);
    }
    texels += count * cols[i];
  });
  return texels;
}

/** The shifts of maps along u and v, 0 for splats without one. */
export function readShifts(block: Block, rows: Uint16Array, cols: Uint16Array, hasContexts: boolean): Int16Array {
  const textured = [...rows.keys()].filter((i) => rows[i] > 0);
  const shifts = new Int16Array(2 * rows.length);
  [rows, cols].forEach((sides, axis) => {
    const contexts = textured.map((i) => Math.min(sides[i], SIDE_CONTEXTS - 1));
    const found = hasContexts ? block.signed(textured.length, contexts, SIDE_CONTEXTS, true) : block.signed(textured.length, undefined, 0, true);
    found.forEach((shift, k) => {
      if (shift << 16 >> 16 !== shift) throw invalid(`splat ${textured[k]}: a shift of ${shift}, expected 16 bits`);
      shifts[2 * textured[k] + axis] = shift;
    });
  });
  return shifts;
}

/** The SH degrees of splats, at most that of the file. `exponents`: 8 more than those of the steps, if they are contexts. */
export function readDegrees(block: Block, count: number, most: number, exponents?: Uint8Array): Uint8Array {
  const stream = block.numbers(count, exponents === undefined ? 0 : 17, 0, true);
  const degrees = new Uint8Array(count).fill(most);
  if (stream === null) return degrees;
  for (let i = 0; i < count; i += 1) {
    const degree = stream.next(exponents === undefined ? 0 : exponents[i]);
    if (degree > most) throw invalid(`splat ${i}: SH degree ${degree}, expected at most ${most}`);
    degrees[i] = degree;
  }
  stream.end();
  return degrees;
}
