import { invalid } from './errors';
import { type Json, numberOf, numbersOf, objectOf } from './json';

/** A transform of points as a matrix of 4 x 4, column by column. */
export type Matrix = readonly number[];

export const IDENTITY: Matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Half a turn about x: from y down to y up, and back. */
const HALF_TURN: Matrix = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];

/** First `b`, then `a`. */
export function product(a: Matrix, b: Matrix): Matrix {
  return IDENTITY.map((_, i) => {
    let sum = 0;
    for (let k = 0; k < 4; k += 1) sum += a[4 * k + (i & 3)] * b[(i & ~3) + k];
    // Without negative zeros.
    return sum + 0;
  });
}

/** The same transform between frames with y up, or with y down. */
export function flipped(matrix: Matrix): Matrix {
  return product(product(HALF_TURN, matrix), HALF_TURN);
}

/** A rotation by a quaternion wxyz of any length but 0, after scaling along the axes, and before a translation. */
export function fromParts([w, x, y, z]: readonly number[], scales: readonly number[], translation: readonly number[]): Matrix {
  const two = 2 / (w * w + x * x + y * y + z * z);
  const rotation = [
    [1 - two * (y * y + z * z), two * (x * y + w * z), two * (x * z - w * y)],
    [two * (x * y - w * z), 1 - two * (x * x + z * z), two * (y * z + w * x)],
    [two * (x * z + w * y), two * (y * z - w * x), 1 - two * (x * x + y * y)],
  ];
  return [...rotation.flatMap((column, i) => [...column.map((value) => value * scales[i]), 0]), ...translation, 1];
}

/** Reads `captureFromLocal` or `worldFromCapture` (`gltf.md`, section 8). */
export function similarityOf(value: unknown, name: string): Matrix {
  const object: Json = objectOf(value, name);
  const scale = numberOf(object.scale, `${name}.scale`);
  const rotation = numbersOf(object.rotation, `${name}.rotation`, 4);
  const translation = numbersOf(object.translation, `${name}.translation`, 3);
  if (!(scale > 0) || Math.abs(Math.hypot(...rotation) - 1) > 1e-5) throw invalid(`${name}: expected a positive scale and a unit quaternion`);
  return fromParts(rotation, [scale, scale, scale], translation);
}
