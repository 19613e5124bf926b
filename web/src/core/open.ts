import type { SceneInfo, Splats, SplatUpdate } from './scene';
import { errorOf, type Source, stored, type StoredSource } from './worker/messages';
import { startReading, type Workers } from './worker/start';

export interface Opened {
    /** Resolves when the whole file is there; rejects with SceneError if it cannot be read, with Error otherwise. */
    readonly done: Promise<void>;
    /**
     * Reads the file once more, with the same callbacks, as for a renderer that has lost its context: from memory, where it is
     * kept as stored once it has arrived as a whole, else from its address.
     */
    again(): Promise<void>;
    /** Stops workers. What `done` and `again` have given stays as it is. */
    close(): void;
}

/**
 * Reads a `.ltgs` or `.glb` file in a worker, layer by layer. `maxSplats`: at most this many, those that contribute most; `onStandIn` gets
 * the file's stand-in before any update, if it has one.
 */
export function openScene(
    source: Source, onInfo: (info: SceneInfo) => void, onUpdate: (update: SplatUpdate) => void, maxSplats = Infinity, onStandIn?: (splats: Splats) => void,
): Opened {
    let workers: Workers | null = null;
    let from: StoredSource | null = null;
    const read = () => new Promise<void>((resolve, reject) => {
        from ??= stored(source);
        workers?.terminate();
        let own: Workers | null = null;
        own = workers = startReading(from, maxSplats, (message) => {
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
    });
    return { done: read(), again: read, close: () => workers?.terminate() };
}
