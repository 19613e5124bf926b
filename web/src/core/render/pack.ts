/** Splats as the shaders fetch them. */

import type { Splats } from '../scene';

/** Numbers of 32 bits per splat: four texels of four. */
export const WORDS_PER_SPLAT = 16;

/**
 * Packs `splats`; the caller says how many coefficients and texels stand before them.
 *
 * Per splat: centre, opacity | rotation xyzw | standard deviations, texel sizes | rows and columns, shifts, first texel,
 * SH degree (2 bits) and first coefficient (30 bits).
 */
export function packSplats(splats: Splats, firstCoefficient: number, firstTexel: number): Uint32Array {
    const words = new Uint32Array(WORDS_PER_SPLAT * splats.count);
    const floats = new Float32Array(words.buffer);
    for (let i = 0, at = 0; i < splats.count; i++, at += WORDS_PER_SPLAT) {
        for (let k = 0; k < 3; k++) floats[at + k] = splats.positions[3 * i + k];
        floats[at + 3] = splats.opacities[i];
        for (let k = 0; k < 4; k++) floats[at + 4 + k] = splats.rotations[4 * i + k];
        for (let k = 0; k < 2; k++) {
            floats[at + 8 + k] = splats.scales[2 * i + k];
            floats[at + 10 + k] = splats.texelSizes[2 * i + k];
        }
        const [rows, cols, degree] = [splats.rows[i], splats.cols[i], splats.shDegrees[i]];
        words[at + 12] = rows | cols << 16;
        words[at + 13] = splats.shifts[2 * i] & 0xffff | splats.shifts[2 * i + 1] << 16;
        words[at + 14] = firstTexel;
        words[at + 15] = degree << 30 | firstCoefficient;
        firstTexel += rows * cols;
        firstCoefficient += (degree + 1) ** 2;
    }
    return words;
}

/**
 * Mean of each map, RGB, as viewers without textures add it to the colour: weighted by the Gaussian at the centres of
 * texels (`gltf.md`, section 10).
 */
export function meansOfMaps(splats: Splats): Float32Array {
    const means = new Float32Array(3 * splats.count);
    for (let i = 0, texel = 0; i < splats.count; i++) {
        const [rows, cols] = [splats.rows[i], splats.cols[i]];
        const alongU = weights(rows, splats.shifts[2 * i], splats.texelSizes[2 * i] / splats.scales[2 * i]);
        const alongV = weights(cols, splats.shifts[2 * i + 1], splats.texelSizes[2 * i + 1] / splats.scales[2 * i + 1]);
        let total = 0;
        const sum = [0, 0, 0];
        for (let row = 0; row < rows; row++) {
            for (let col = 0; col < cols; col++, texel++) {
                const weight = alongU[row] * alongV[col];
                total += weight;
                for (let c = 0; c < 3; c++) sum[c] += weight * splats.texels[3 * texel + c];
            }
        }
        const area = splats.texelSizes[2 * i] * splats.texelSizes[2 * i + 1] / (splats.scales[2 * i] * splats.scales[2 * i + 1]);
        const divisor = Math.max(total, 2 * Math.PI / area);
        if (divisor > 0 && divisor < Infinity) for (let c = 0; c < 3; c++) means[3 * i + c] = sum[c] / divisor;
    }
    return means;
}

/** The Gaussian at the centres of `side` texels; `size` is that of a texel in standard deviations. */
function weights(side: number, shift: number, size: number): Float64Array {
    return Float64Array.from({ length: side }, (_, k) => Math.exp(-0.5 * ((k - 0.5 * (side - 1 - shift)) * size) ** 2));
}
