/** Reads files into objects of other engines. */

import { openScene } from '../core/open';
import type { SceneInfo, SplatUpdate } from '../core/scene';
import type { Source } from '../core/worker/messages';

interface Receiver {
    /** The rest of the file. */
    loaded: Promise<void>;
    apply(update: SplatUpdate): void;
    dispose(): void;
}

/**
 * Reads a file into what `make` makes. `onUpdate` is called after each part, and says whether the object is still
 * ours: to be disposed of if the rest cannot be read.
 */
export function readInto<T extends Receiver>(
    source: Source, make: (info: SceneInfo) => T, maxSplats = Infinity, onUpdate: (made: T, update: SplatUpdate) => boolean = () => true,
): Promise<T> {
    let made: T | null = null;
    let isOurs = true;
    const take = (update: SplatUpdate) => {
        made!.apply(update);
        isOurs = onUpdate(made!, update);
    };
    const reading = openScene(source, (info) => {
        made = make(info);
        made.loaded = reading;
    }, take, maxSplats).done;
    return reading.then(() => made!, (error: unknown) => {
        if (isOurs) made?.dispose();
        throw error;
    });
}
