import { check } from './errors';
import { numberOf, numbersOf, objectOf } from './json';

/** A transform of points as a matrix of 4 x 4, column by column. */
export type Matrix = readonly number[];

export const IDENTITY: Matrix = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Half a turn about x: from y down to y up, and back. */
export const HALF_TURN: Matrix = [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];

/** First `b`, then `a`. */
export function product(a: Matrix, b: Matrix): Matrix {
    return IDENTITY.map((_, i) => {
        const [row, column] = [i & 3, i & 12];
        return a[row] * b[column] + a[row + 4] * b[column + 1] + a[row + 8] * b[column + 2] + a[row + 12] * b[column + 3];
    });
}

/** The same transform between frames with y up, or with y down. */
export function flipped(matrix: Matrix): Matrix {
    return product(product(HALF_TURN, matrix), HALF_TURN);
}

/** A scaling along the axes, a rotation by a quaternion wxyz of any length but 0, and a translation. */
export function fromParts([w, x, y, z]: readonly number[], [a, b, c]: readonly number[], translation: readonly number[]): Matrix {
    const two = 2 / (w * w + x * x + y * y + z * z);
    return [
        ...[1 - two * (y * y + z * z), two * (x * y + w * z), two * (x * z - w * y)].map((v) => a * v),
        0,
        ...[two * (x * y - w * z), 1 - two * (x * x + z * z), two * (y * z + w * x)].map((v) => b * v),
        0,
        ...[two * (x * z + w * y), two * (y * z - w * x), 1 - two * (x * x + y * y)].map((v) => c * v),
        0,
        ...translation,
        1,
    ];
}

/** Reads `captureFromLocal` or `worldFromCapture` (`gltf.md`, section 8). */
export function similarityOf(value: unknown, name: string): Matrix {
    const { scale, rotation, translation } = objectOf(value, name);
    const quaternion = numbersOf(rotation, name, 4);
    check(Math.abs(Math.hypot(...quaternion) - 1) < 1e-5, name, quaternion, 'a unit quaternion');
    return fromParts(quaternion, Array(3).fill(numberOf(scale, name, Number.MIN_VALUE)), numbersOf(translation, name, 3));
}
