import { check } from '../errors';
import type { Block } from './streams';

/** Largest side of a map, texels. */
export const SIDE_MAX = 4096;

/** The splats that have a map. */
export function texturedOf(rows: ArrayLike<number>): number[] {
    return Array.from(rows, (count, i) => (count > 0 ? i : -1)).filter((i) => i >= 0);
}

/** Texels of maps with these sides, which are checked (`ltgs.md`, section 2). */
export function texelsOf(rows: Uint16Array, cols: Uint16Array): number {
    return rows.reduce((sum, count, i) => {
        const fits = count > 0 === cols[i] > 0 && count <= SIDE_MAX && cols[i] <= SIDE_MAX;
        check(fits, 'sides of a map', `${count} x ${cols[i]}`, `1 to ${SIDE_MAX}`);
        return sum + count * cols[i];
    }, 0);
}

/** The shifts of maps along u and v, 0 for splats without one. `hasContexts`: as in lossy files. */
export function readShifts(block: Block, rows: Uint16Array, cols: Uint16Array, hasContexts: boolean): Int16Array {
    const textured = texturedOf(rows);
    const shifts = new Int16Array(2 * rows.length);
    [rows, cols].forEach((sides, axis) => {
        const contexts = hasContexts ? Uint8Array.from(textured, (i) => Math.min(sides[i], 12)) : undefined;
        block.signed(textured.length, contexts, true).forEach((shift, k) => {
            check((shift << 16) >> 16 === shift, 'shift of a map', shift, '16 bits');
            shifts[2 * textured[k] + axis] = shift;
        });
    });
    return shifts;
}

/** The SH degrees of splats, at most that of the file. */
export function readDegrees(block: Block, count: number, most: number, classes?: Uint8Array): Uint8Array {
    const stream = block.begin(count, classes ? 17 : 0, 0, true);
    const degrees = new Uint8Array(count).fill(most);
    if (stream === null) return degrees;
    for (let i = 0; i < count; i += 1) {
        const degree = stream.next(classes ? classes[i] : 0);
        check(degree <= most, 'SH degree of a splat', degree, `at most ${most}`);
        degrees[i] = degree;
    }
    stream.end();
    return degrees;
}
