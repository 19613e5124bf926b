import type { SortView } from '../render/sort';
import type { SceneInfo, SplatUpdate } from '../scene';

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
    | { kind: 'failed'; name: string; errorKind: string; message: string };
