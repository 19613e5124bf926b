import type { SceneInfo, Splats, SplatUpdate } from './scene';
import { errorOf, type Source, stored, type StoredSource } from './worker/messages';
import { startReading, startWorker } from './worker/start';

export interface Opened {
    /** Resolves when the whole file is there; rejects with SceneError if it cannot be read, with Error otherwise. */
    readonly done: Promise<void>;
    /**
     * Reads the file once more, with the same callbacks, as for a renderer that has lost its context: from memory, where it is
     * kept as stored once it has arrived as a whole, else from its address.
     */
    again(): Promise<void>;
    /** Stops reading. What `done` and `again` have given stays as it is. */
    close(): void;
}

/**
 * Reads a `.ltgs` or `.glb` file in a worker, layer by layer. `maxSplats`: at most this many, those that contribute most; `onStandIn` gets
 * the file's stand-in before any update, if it has one.
 */
export function openScene(
    source: Source, onInfo: (info: SceneInfo) => void, onUpdate: (update: SplatUpdate) => void, maxSplats = Infinity, onStandIn?: (splats: Splats) => void,
): Opened {
    let worker: Worker | null = null;
    let from: StoredSource | null = null;
    const read = () => new Promise<void>((resolve, reject) => {
        from ??= stored(source);
        worker?.terminate();
        let own: Worker | null = null;
        own = worker = startWorker((message) => {
            try {
                if (message.kind === 'info') onInfo(message.info);
                if (message.kind === 'standIn') onStandIn?.(message.splats);
                if (message.kind === 'update') onUpdate(message.update);
            } catch (error) {
                own?.terminate();
                reject(error); // the caller's own
            }
            if (message.kind === 'failed') reject(errorOf(message));
            if (message.kind === 'done') {
                from = message.kept;
                resolve();
            }
            if (message.kind === 'done' || message.kind === 'failed') own?.terminate();
        });
        startReading(worker, from, maxSplats);
    });
    return { done: read(), again: read, close: () => worker?.terminate() };
}
