/** Images of the program, for comparison. */

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import type { Drawn } from './harness';
import { FloatType } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';

export interface FloatImage {
    width: number;
    height: number;
    /** RGB in display space, in [0, 1], rows from the top. */
    rgb: Float32Array;
}

/** What `litetex render` makes of a view of a file. */
export function reference(litetex: string, file: string, view: string, extra: readonly string[] = []): FloatImage {
    const out = mkdtempSync(join(tmpdir(), 'reference-'));
    execFileSync(litetex, ['-q', 'render', file, '--view', view, '--exr', '--device', 'cpu', '-o', out, ...extra]);
    const name = readdirSync(out).find((entry) => entry.endsWith('.exr'))!;
    const bytes = readFileSync(join(out, name));
    const { data, width, height } = new EXRLoader().setDataType(FloatType).parse(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) as ArrayBuffer) as unknown as { data: Float32Array; width: number; height: number };
    const channels = data.length / (width * height);
    const rgb = new Float32Array(3 * width * height);
    for (let y = 0; y < height; y++) {
        for (let x = 0; x < width; x++) {
            // The loader gives rows from the bottom.
            for (let c = 0; c < 3; c++) rgb[3 * (y * width + x) + c] = encoded(data[channels * ((height - 1 - y) * width + x) + c]);
        }
    }
    return { width, height, rgb };
}

function encoded(linear: number): number {
    const c = Math.min(1, Math.max(0, linear));
    return c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
}

/** PSNR in dB, peak 1, and the largest difference, of images in [0, 1]. */
export function compare(a: Float32Array, b: Float32Array): { psnr: number; largest: number } {
    if (a.length !== b.length) throw new Error(`images of ${a.length} and ${b.length} numbers`);
    let sum = 0, largest = 0;
    for (let i = 0; i < a.length; i++) {
        const difference = Math.abs(Math.min(1, Math.max(0, a[i])) - b[i]);
        sum += difference ** 2;
        largest = Math.max(largest, difference);
    }
    return { psnr: -10 * Math.log10(sum / a.length), largest };
}

/** RGB in display space of an image over an opaque background. */
export function rgbOf({ floats, linear }: Drawn): Float32Array {
    const bytes = Buffer.from(floats, 'base64');
    const rgba = new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
    return Float32Array.from({ length: rgba.length / 4 * 3 }, (_, i) => {
        const value = rgba[4 * Math.floor(i / 3) + i % 3];
        return linear ? encoded(value) : value;
    });
}

/** RGB of the canvas. */
export function rgbOfBytes({ bytes, width, height }: Drawn): Float32Array {
    const rgba = Buffer.from(bytes, 'base64');
    return Float32Array.from({ length: 3 * width * height }, (_, i) => {
        const [pixel, channel] = [Math.floor(i / 3), i % 3];
        const [x, y] = [pixel % width, Math.floor(pixel / width)];
        return rgba[4 * ((height - 1 - y) * width + x) + channel] / 255;
    });
}
