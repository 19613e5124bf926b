import { readScene } from '../read';
import { SceneError, type Splats } from '../scene';
import type { FromWorker, Source } from './messages';

/** Reads a file and posts what has arrived. */
export async function readFrom(
    source: Source, maxSplats: number, post: (message: FromWorker, transfer?: Transferable[]) => void,
): Promise<void> {
    try {
        const { input, fileBytes } = await open(source);
        await readScene(input, {
            maxSplats,
            ...(fileBytes === undefined ? {} : { fileBytes }),
            onInfo: (info) => post({ kind: 'info', info }),
            onUpdate: (update) => post({ kind: 'update', update: { ...update, splats: owned(update.splats) } }),
        });
        post({ kind: 'done' });
    } catch (error) {
        const message = error instanceof Error ? error.message : String(error);
        post({ kind: 'failed', message, errorKind: error instanceof SceneError ? error.kind : null });
    }
}

async function open(source: Source): Promise<{ input: Uint8Array | ReadableStream<Uint8Array>; fileBytes?: number }> {
    if ('bytes' in source) return { input: new Uint8Array(source.bytes), fileBytes: source.bytes.byteLength };
    const response = await fetch(source.url);
    if (!response.ok || !response.body) throw new Error(`${source.url}: the server answers ${response.status} ${response.statusText}`);
    const length = response.headers.get('content-encoding') ? null : response.headers.get('content-length');
    return { input: response.body, ...(length === null ? {} : { fileBytes: Number(length) }) };
}

/** Copies arrays that are parts of larger ones, which would be posted whole. */
function owned(splats: Splats): Splats {
    const entries = Object.entries(splats).map(([name, value]) => [name, ArrayBuffer.isView(value) ? (value as Float32Array).slice() : value]);
    return Object.fromEntries(entries) as Splats;
}
