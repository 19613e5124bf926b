import { SceneError, type SceneInfo } from '../scene';
import { readGlb } from './gltf/read';
import { readLtgs } from './ltgs/read';
import type { ReadOptions } from './options';
import { HEAD_BYTES, nameOf } from './sniff';
import { openSource } from './source';

export type { ReadOptions } from './options';
export { SceneSplats, concatenate } from './splats';

/**
 * Reads a `.ltgs` file (`exporters/schema/ltgs.md`) or a `.glb` file of splats (`exporters/schema/gltf.md`).
 *
 * Bytes may be a part of a larger buffer, a Buffer of Node.js, or in memory that threads share; they stay as they are. So may the
 * pieces of a stream.
 *
 * Rejects with SceneError for a file that is damaged or of another kind, with the reason of `signal` if that is aborted, and
 * with the error of a stream that fails. What was given in updates before can be shown.
 */
export async function readScene(
    from: ArrayBuffer | Uint8Array | ReadableStream<Uint8Array>,
    options: ReadOptions = {},
): Promise<SceneInfo> {
    const { source, close } = openSource(from, options.signal);
    try {
        const head = await source.peek(HEAD_BYTES);
        const magic = String.fromCharCode(...head.subarray(0, 4));
        if (magic !== 'LTGS' && magic !== 'glTF') throw new SceneError('unsupported', `file: found ${nameOf(head)}, expected .ltgs or .glb`);
        return await (magic === 'LTGS' ? readLtgs : readGlb)(source, options);
    } finally {
        close();
    }
}
