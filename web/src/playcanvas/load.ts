import type { AppBase } from 'playcanvas';
import type { Source } from '../core/worker/messages';
import { readInto } from '../guest/load';
import { LitetexSplats, type LitetexSplatsOptions } from './splats';

/**
 * Loads a `.ltgs` or `.glb` file, from an address or as bytes in memory. Resolves when the first layer of a `.ltgs` file is there, and adds
 * the others as they arrive; `splats.loaded` tells when all are. Rejects with a SceneError if the file is damaged or of another
 * kind. The entity stands in the world of the file, with y up, once it is added to the app.
 */
export function loadSplats(app: AppBase, source: string | ArrayBuffer | Uint8Array, options: LitetexSplatsOptions = {}): Promise<LitetexSplats> {
    return new Promise((resolve, reject) => {
        const from: Source = typeof source === 'string' ? { url: source } : { bytes: source };
        readInto(from, (info) => new LitetexSplats(app, info, options), options.maxSplats, (splats) => {
            resolve(splats);
            return false;
        }).then(resolve, reject);
    });
}
