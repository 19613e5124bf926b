/** The splats of a file without their colours, for looking up surfaces. */

import type { Splats } from '../core/scene';
import { type KeptFile, errorOf } from '../core/worker/messages';
import { startReading } from '../core/worker/start';

export type SplatSurfaces = readonly { readonly first: number; readonly splats: Splats }[];

const NONE = new Float32Array(0);

/**
 * Reads a file once more: a viewer has its splats on the GPU only. Rejects if no worker can be had, or the browser has dropped
 * the file.
 */
export function readSurfaces(file: KeptFile, maxSplats: number): Promise<SplatSurfaces> {
    return new Promise((resolve, reject) => {
        let parts: { first: number; splats: Splats }[] = [];
        const workers = startReading(file, maxSplats, (message) => {
            if (message.kind === 'update') {
                const { first, splats } = message.update;
                const { count, positions, rotations, scales, opacities } = splats;
                // Copies: the arrays may be parts of memory that colours are in, too.
                const [p, r, s, o] = [positions.slice(), rotations.slice(), scales.slice(), opacities.slice()];
                const kept = Math.max(0, Math.min(count, maxSplats - first));
                parts = parts.filter((part) => part.first < first).map((part) => cut(part, first));
                parts.push({ first, splats: { ...splats, count: kept, positions: p, rotations: r, scales: s, opacities: o, sh: NONE, texels: NONE } });
            } else if (message.kind === 'done') {
                workers?.terminate();
                resolve(parts);
            } else if (message.kind === 'failed') {
                workers?.terminate();
                reject(errorOf(message));
            }
        });
        if (!workers) reject(new Error('this browser starts no worker'));
    });
}

/** A part that ends before splat `end`. */
function cut({ first, splats }: { first: number; splats: Splats }, end: number): { first: number; splats: Splats } {
    return { first, splats: { ...splats, count: Math.min(splats.count, end - first) } };
}
