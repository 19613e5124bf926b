/** Places of maps in the atlas. */

import { describe, expect, test } from 'vitest';
import { ATLAS_COLUMNS, AtlasLayout, extentOf, NO_PLACE } from '../../src/core/render/layout';

const side = (rows: number, cols: number) => rows + 65536 * cols;
/** Maps of many sizes, and splats without. */
const SIDES = Uint32Array.from({ length: 3000 }, (_, i) => (i % 5 === 0 ? 0 : side(1 + (i * 7) % 40, 1 + (i * 13) % 30)));

/** Splats that cover each texel of the atlas, with a border on every side, must be one at most. */
function check(layout: AtlasLayout, sides: Uint32Array, halvings: number): void {
    const owner = new Int32Array(ATLAS_COLUMNS * (layout.rows + 1)).fill(-1);
    layout.places.forEach((place, splat) => {
        if (place === NO_PLACE) return;
        const [column, row] = [place & 0xffff, place >>> 16];
        const [height, width] = [extentOf(sides[splat] & 0xffff, halvings), extentOf(sides[splat] >>> 16, halvings)];
        if (column + width >= ATLAS_COLUMNS || row + height >= layout.rows) throw new Error(`splat ${splat} has no border`);
        for (let y = row; y < row + height; y++) {
            for (let x = column; x < column + width; x++) {
                if (owner[y * ATLAS_COLUMNS + x] >= 0) throw new Error(`splats ${owner[y * ATLAS_COLUMNS + x]} and ${splat} share a texel`);
                owner[y * ATLAS_COLUMNS + x] = splat;
            }
        }
    });
}

test('blocks have a border before each copy', () => {
    expect(extentOf(4, 0)).toBe(5);
    expect(extentOf(5, 1)).toBe(1 + 5 + 1 + 3);
    expect(extentOf(1, 3)).toBe(8);
});

describe.each([0, 1, 3])('%d halvings', (halvings) => {
    test('maps do not overlap, and fill half of the rows at least', () => {
        const layout = new AtlasLayout(SIDES.length, 8192, halvings);
        layout.extend(SIDES, SIDES.length);
        check(layout, SIDES, halvings);
        const used = SIDES.reduce((sum, one) => sum + (one ? extentOf(one & 0xffff, halvings) * extentOf(one >>> 16, halvings) : 0), 0);
        expect(used / (ATLAS_COLUMNS * layout.rows)).toBeGreaterThan(0.5);
        SIDES.forEach((one, splat) => expect(layout.places[splat] === NO_PLACE).toBe(one === 0));
    });

    test('splats that arrive in parts, some of them anew, stand where nothing else does', () => {
        const layout = new AtlasLayout(SIDES.length, 8192, halvings);
        for (const [first, end] of [[0, 500], [500, 1200], [700, 1500], [1500, 3000], [100, 3000]]) {
            layout.truncate(first);
            expect(layout.count).toBeLessThanOrEqual(first);
            layout.extend(SIDES, end);
            check(layout, SIDES, halvings);
        }
        expect(layout.count).toBe(SIDES.length);
    });
});

test('what finds no room has no place', () => {
    const layout = new AtlasLayout(SIDES.length, 100, 0);
    layout.extend(SIDES, SIDES.length);
    expect(layout.rows).toBeLessThanOrEqual(100);
    const placed = layout.places.filter((place) => place !== NO_PLACE).length;
    expect(placed).toBeGreaterThan(100);
    expect(placed).toBeLessThan(2400);
    check(layout, SIDES, 0);
});

test('a map wider than the atlas has no place, those after it have', () => {
    const sides = Uint32Array.from([side(2, 5000), side(3, 3)]);
    const layout = new AtlasLayout(2, 100, 1);
    layout.extend(sides, 2);
    expect(layout.places[0]).toBe(NO_PLACE);
    expect(layout.places[1]).not.toBe(NO_PLACE);
});
