import type { SortView } from '../render/sort';
import { SceneError, type SceneInfo, type SplatUpdate } from '../scene';

/** What a file is read from: an address, or its bytes. */
export type Source = { readonly url: string } | { readonly bytes: ArrayBuffer };

export type ToWorker =
    | { kind: 'positions'; first: number; xyz: Float32Array }
    | { kind: 'sort'; view: SortView; generation: number }
    | { kind: 'read'; source: Source; maxSplats: number };

export type FromWorker =
    | { kind: 'order'; order: Uint32Array; generation: number; ms: number }
    | { kind: 'info'; info: SceneInfo }
    | { kind: 'update'; update: SplatUpdate }
    | { kind: 'done' }
    | Failed;

interface Failed {
    kind: 'failed';
    /** Kind of a SceneError; null for other errors, as of the network. */
    errorKind: SceneError['kind'] | null;
    message: string;
}

/** The error that a worker met, which cannot itself be posted. */
export function errorOf({ errorKind, message }: Failed): Error {
    return errorKind ? new SceneError(errorKind, message) : new Error(message);
}
