import { expect, test } from 'vitest';
import { meansOfMaps, packSplats, WORDS_PER_SPLAT } from '../../src/core/render/pack';
import type { Splats } from '../../src/core/scene';

/** Two splats: one of degree 1 with a map of 2 x 3, one of degree 0 without. */
const SPLATS: Splats = {
    count: 2,
    positions: new Float32Array([1, 2, 3, 4, 5, 6]),
    rotations: new Float32Array([0, 0.6, 0, 0.8, 0, 0, 0, 1]),
    scales: new Float32Array([0.25, 0.125, 1, 2]),
    opacities: new Float32Array([0.75, 0.5]),
    shDegrees: new Uint8Array([1, 0]),
    sh: new Float32Array(3 * 5),
    rows: new Uint16Array([2, 0]),
    cols: new Uint16Array([3, 0]),
    texelSizes: new Float32Array([0.25, 0.25, 0, 0]),
    shifts: new Int16Array([-3, 1, 0, 0]),
    texels: new Float32Array([0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5, 0.25, 0.25, 0, 0, 0.25, 0.25, -0.5, 0, 0.25]),
};

test('splats are packed with what stands before them', () => {
    const words = packSplats(SPLATS, 100, 7000);
    const floats = new Float32Array(words.buffer);
    expect(words.length).toBe(2 * WORDS_PER_SPLAT);
    expect([...floats.subarray(0, 4)]).toEqual([1, 2, 3, 0.75]);
    expect(words[12]).toBe(2 | 3 << 16);
    expect([words[13] << 16 >> 16, words[13] >> 16]).toEqual([-3, 1]);
    expect([words[14], words[15] >>> 30, words[15] & 0x3fffffff]).toEqual([7000, 1, 100]);
    expect([words[30], words[31] >>> 30, words[31] & 0x3fffffff]).toEqual([7006, 0, 104]);
});

test('the mean of a map is weighted by the Gaussian, over the area of the whole splat', () => {
    const means = meansOfMaps(SPLATS);
    const [sigma, k] = [[0.25, 0.125], [0.25, 0.25]];
    let total = 0;
    const sum = [0, 0, 0];
    for (let i = 0; i < 2; i++) {
        for (let j = 0; j < 3; j++) {
            const [a, b] = [(i - 0.5 * (1 + 3)) * k[0], (j - 0.5 * (2 - 1)) * k[1]];
            const weight = Math.exp(-0.5 * ((a / sigma[0]) ** 2 + (b / sigma[1]) ** 2));
            total += weight;
            for (let c = 0; c < 3; c++) sum[c] += weight * SPLATS.texels[3 * (3 * i + j) + c];
        }
    }
    const area = 2 * Math.PI * sigma[0] * sigma[1] / (k[0] * k[1]);
    expect(area).toBeGreaterThan(total);
    for (let c = 0; c < 3; c++) expect(means[c]).toBeCloseTo(sum[c] / area, 6);
    expect([...means.subarray(3)]).toEqual([0, 0, 0]);
});
