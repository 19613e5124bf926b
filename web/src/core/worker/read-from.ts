import { readScene } from '../read';
import type { Helpers } from '../read/ltgs/job';
import type { HelpedOptions } from '../read/options';
import type { Splats } from '../scene';
import { fetchFile, streamOf } from './fetch-file';
import { buffersOf, failureOf, type FromWorker, type KeptFile, type StoredSource } from './messages';

/** Reads a file and posts what has arrived. */
export async function readFrom(
    source: StoredSource, maxSplats: number, post: (message: FromWorker, transfer?: Transferable[]) => void, helpers?: Helpers,
): Promise<void> {
    const give = (message: FromWorker) => post(message, buffersOf(message));
    try {
        const { input, fileBytes, kept } = await open(source);
        const options: HelpedOptions = {
            maxSplats,
            ...(helpers && { helpers }),
            ...(fileBytes === undefined ? {} : { fileBytes }),
            onInfo: (info) => post({ kind: 'info', info }),
            onStandIn: (splats) => give({ kind: 'standIn', splats: owned(splats) }),
            onUpdate: (update) => give({ kind: 'update', update: { ...update, splats: owned(update.splats) } }),
        };
        await readScene(input, options);
        post({ kind: 'done', kept: kept() });
    } catch (error) {
        post(failureOf(error));
    }
}

/** `kept`: what has been read, which is the whole file unless fewer splats are wanted. */
async function open(source: StoredSource): Promise<{ input: Uint8Array | ReadableStream<Uint8Array>; fileBytes: number | undefined; kept: () => KeptFile }> {
    if ('file' in source) {
        const { file, fileBytes = file.size } = source;
        return { input: new Uint8Array(await file.arrayBuffer()), fileBytes, kept: () => source };
    }
    const response = await fetchFile(source.url);
    const length = response.headers.get('content-encoding') ? null : response.headers.get('content-length');
    const fileBytes = length === null ? undefined : Number(length);
    const pieces: Uint8Array<ArrayBuffer>[] = [];
    const input = streamOf(response, source.url, (piece) => pieces.push(piece));
    return { input, fileBytes, kept: () => ({ file: new Blob(pieces), ...(fileBytes === undefined ? {} : { fileBytes }) }) };
}

/** Copies arrays: the reader keeps its own, and parts of larger ones would be posted whole. */
function owned(splats: Splats): Splats {
    const entries = Object.entries(splats).map(([name, value]) => [name, ArrayBuffer.isView(value) ? (value as Float32Array).slice() : value]);
    return Object.fromEntries(entries) as Splats;
}
