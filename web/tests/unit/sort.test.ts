import { expect, test } from 'vitest';
import { Sorter, type SortView } from '../../src/core/render/sort';

const VIEW: SortView = { axis: [0.36, -0.48, 0.8], offset: 3 };

/** Reproducible numbers in [0, 1). */
function random(seed: number): () => number {
    let state = seed;
    return () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32;
}

function positions(count: number, spread: number): Float32Array {
    const next = random(count);
    return Float32Array.from({ length: 3 * count }, () => spread * (2 * next() - 1));
}

function depths(xyz: Float32Array, { axis, offset }: SortView): Float32Array {
    return Float32Array.from({ length: xyz.length / 3 }, (_, i) => axis[0] * xyz[3 * i] + axis[1] * xyz[3 * i + 1] + axis[2] * xyz[3 * i + 2] + offset);
}

/** Gives all splats their order. */
function sorted(xyz: Float32Array, view = VIEW): Uint32Array {
    const sorter = new Sorter();
    sorter.set(0, xyz);
    const order = new Uint32Array(xyz.length / 3);
    expect(sorter.sort(view, order)).toBe(order.length);
    return order;
}

test('splats are sorted exactly, far to near, and of equal depths the later first', () => {
    const xyz = positions(5000, 1.5);
    for (let i = 0; i < 300; i++) xyz.copyWithin(3 * (i + 4000), 3 * (7 * i), 3 * (7 * i) + 3);
    const depth = depths(xyz, VIEW);
    const expected = Uint32Array.from({ length: 5000 }, (_, i) => i).sort((a, b) => depth[b] - depth[a] || b - a);
    expect(sorted(xyz)).toEqual(expected);
});

test('control: one pass over 16 bits of the range gives another order', () => {
    const xyz = positions(5000, 1.5);
    const depth = depths(xyz, VIEW);
    const [low, high] = [Math.min(...depth), Math.max(...depth)];
    const key = depth.map((z) => Math.floor((z - low) / (high - low) * 65535));
    const coarse = Uint32Array.from({ length: 5000 }, (_, i) => i).sort((a, b) => key[b] - key[a] || b - a);
    expect(sorted(xyz)).not.toEqual(coarse);
});

test('splats behind the camera are kept, last', () => {
    const xyz = new Float32Array([0, 0, -5, 0, 0, 1, 0, 0, -4, 0, 0, 2]);
    expect([...sorted(xyz, { axis: [0, 0, 1], offset: 0 })]).toEqual([3, 1, 2, 0]);
});

test('splats are added, replaced and dropped', () => {
    const sorter = new Sorter();
    const view: SortView = { axis: [0, 0, 1], offset: 0 };
    const order = new Uint32Array(3);
    sorter.set(0, new Float32Array([0, 0, 1, 0, 0, 2]));
    sorter.set(1, new Float32Array([0, 0, 5, 0, 0, 3]));
    expect(sorter.sort(view, order)).toBe(3);
    expect([...order]).toEqual([1, 2, 0]);
    sorter.set(1, new Float32Array(0));
    expect(sorter.sort(view, order)).toBe(1);
});
