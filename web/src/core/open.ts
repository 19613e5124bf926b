import type { SceneInfo, SplatUpdate } from './scene';
import { errorOf, type Source } from './worker/messages';
import { startReading, startWorker } from './worker/start';

export interface Opened {
    /** Resolves when the whole file is there; rejects with SceneError if it cannot be read, with Error otherwise. */
    readonly done: Promise<void>;
    /** Stops reading. `done` stays as it is. */
    close(): void;
}

/** Reads a `.ltgs` or `.glb` file in a worker, layer by layer. `maxSplats`: at most this many, those that contribute most. */
export function openScene(
    source: Source, onInfo: (info: SceneInfo) => void, onUpdate: (update: SplatUpdate) => void, maxSplats = Infinity,
): Opened {
    let worker: Worker | null = null;
    const done = new Promise<void>((resolve, reject) => {
        worker = startWorker((message) => {
            try {
                if (message.kind === 'info') onInfo(message.info);
                if (message.kind === 'update') onUpdate(message.update);
            } catch (error) {
                worker?.terminate();
                reject(error); // the caller's own
            }
            if (message.kind === 'failed') reject(errorOf(message));
            if (message.kind === 'done') resolve();
            if (message.kind === 'done' || message.kind === 'failed') worker?.terminate();
        });
        startReading(worker, source, maxSplats);
    });
    return { done, close: () => worker?.terminate() };
}
