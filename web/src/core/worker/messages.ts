import type { SortView } from '../render/sort';
import { SceneError, type SceneInfo, type Splats, type SplatUpdate } from '../scene';

/** What a file is read from: an address, or its bytes, which are copied. */
export type Source = { readonly url: string } | { readonly bytes: ArrayBuffer | Uint8Array } | KeptFile;

/**
 * Bytes of a file that can be read again, as after the loss of a WebGL context. As stored, not decoded: of a `.ltgs` file
 * that is a ninth of the memory (measured: fox, 161 kB for 1.4 MB of splats). Browsers may even keep a Blob on disk.
 */
export interface KeptFile {
    readonly file: Blob;
    /** Of the whole file, if only its beginning has been read. */
    readonly fileBytes?: number;
}

/** A source that can be posted, and opened again. */
export type StoredSource = { readonly url: string } | KeptFile;

/** Takes a copy of bytes, and completes addresses: the worker has one of its own, to which they would be relative. Throws if one is none. */
export function stored(source: Source): StoredSource {
    if ('url' in source) {
        try {
            return { url: new URL(source.url, document.baseURI).href };
        } catch {
            throw new Error(`${source.url}: not a valid URL`);
        }
    }
    if ('file' in source) return source;
    const { bytes } = source;
    // Of memory that threads share no Blob is made.
    const isShared = ArrayBuffer.isView(bytes) && !(bytes.buffer instanceof ArrayBuffer);
    return { file: new Blob([(isShared ? bytes.slice() : bytes) as ArrayBuffer]) };
}

export type ToWorker =
    | { kind: 'positions'; first: number; xyz: Float32Array }
    | { kind: 'sort'; view: SortView; generation: number }
    | { kind: 'read'; source: StoredSource; maxSplats: number }
    /** To one that reads: another worker, which will help. */
    | { kind: 'helper'; port: MessagePort }
    /** To that one. */
    | { kind: 'help'; port: MessagePort };

export type FromWorker =
    | { kind: 'order'; order: Uint32Array; generation: number; ms: number }
    | { kind: 'info'; info: SceneInfo }
    | { kind: 'standIn'; splats: Splats }
    | { kind: 'update'; update: SplatUpdate }
    | { kind: 'done'; kept: KeptFile }
    /** The number of chunks that it begins to decode, for which helpers are wanted. */
    | { kind: 'chunks'; chunks: number }
    | Failed;

export interface Failed {
    kind: 'failed';
    /** Kind of a SceneError; null for other errors, as of the network. */
    errorKind: SceneError['kind'] | null;
    message: string;
}

/** The error that a worker met, which cannot itself be posted. */
export function errorOf({ errorKind, message }: Failed): Error {
    return errorKind ? new SceneError(errorKind, message) : new Error(message);
}

/** An error as it is posted. */
export function failureOf(error: unknown): Failed {
    const message = error instanceof Error ? error.message : String(error);
    return { kind: 'failed', message, errorKind: error instanceof SceneError ? error.kind : null };
}

/** The memory of arrays, which is not copied if it is posted with them. */
export function buffersOf(value: object): ArrayBuffer[] {
    const all = Object.values(value).flatMap((own: unknown) => {
        if (ArrayBuffer.isView(own)) return [own.buffer as ArrayBuffer];
        return typeof own === 'object' && own ? buffersOf(own) : [];
    });
    return [...new Set(all)];
}
