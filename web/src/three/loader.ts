/** Loads files as objects of three.js. */

import { Loader, type LoadingManager, Matrix4 } from 'three';
import type { SplatUpdate } from '../core/scene';
import { fetchFile } from '../core/worker/fetch-file';
import type { Source } from '../core/worker/messages';
import type { SplatsOptions } from '../guest/data';
import { readInto } from '../guest/load';
import { LitetexSplats } from './splats';

/**
 * Loads `.ltgs` and `.glb` files. The object stands in the world of the file, with y up.
 *
 * A `.ltgs` file comes in layers: `load` and `loadAsync` give the object when the first one is there, and the others are
 * added as they arrive; `splats.loaded` tells when all are. `onProgress` is called after each. With `wholeFile` they wait
 * for the end.
 */
export class LitetexLoader extends Loader<LitetexSplats> {
    /** Whether objects are given only when their whole file is there. */
    wholeFile = false;
    /** For the objects: the most splats that are shown, and the bits of colours. */
    options: SplatsOptions = {};

    constructor(manager?: LoadingManager) {
        super(manager);
    }

    /** Sets `options`. */
    setOptions(options: SplatsOptions): this {
        this.options = options;
        return this;
    }

    /** `onError` gets a SceneError if the file is damaged or of another kind; also when that shows only after `onLoad`. */
    override load(url: string, onLoad: (splats: LitetexSplats) => void, onProgress?: (event: ProgressEvent) => void, onError?: (error: unknown) => void): void {
        const address = this.manager.resolveURL(new URL(this.path + url, globalThis.location?.href).href);
        this.manager.itemStart(url);
        this.source(address)
            .then((source) => this.read(source, onLoad, onProgress))
            .catch((error: unknown) => {
                if (onError) onError(error);
                else console.error(error);
                this.manager.itemError(url);
            })
            .finally(() => this.manager.itemEnd(url));
    }

    /** Reads a whole file that is in memory; see `parseAsync`. */
    parse(data: ArrayBuffer, onLoad: (splats: LitetexSplats) => void, onError?: (error: unknown) => void): void {
        this.parseAsync(data).then(onLoad, onError ?? console.error);
    }

    /** Reads a whole file that is in memory. Rejects with a SceneError if it is damaged or of another kind. */
    parseAsync(data: ArrayBuffer): Promise<LitetexSplats> {
        return loadSplats({ bytes: data }, this.options).then(placed);
    }

    /** A file that needs headers or cookies is fetched here, as a whole. */
    private async source(url: string): Promise<Source> {
        if (Object.keys(this.requestHeader).length === 0 && !this.withCredentials) return { url };
        const response = await fetchFile(url, { headers: this.requestHeader, credentials: this.withCredentials ? 'include' : 'same-origin' });
        return { bytes: await response.arrayBuffer() };
    }

    private async read(source: Source, onLoad: (splats: LitetexSplats) => void, onProgress?: (event: ProgressEvent) => void): Promise<void> {
        let isGiven = false;
        const give = (splats: LitetexSplats) => {
            if (!isGiven) onLoad(placed(splats));
            isGiven = true;
        };
        const splats = await loadSplats(source, this.options, (object, { bytes }) => {
            const total = object.info.fileBytes;
            onProgress?.(new ProgressEvent('progress', { lengthComputable: total > 0, loaded: bytes, total }));
            if (this.wholeFile) return true;
            give(object);
            return false;
        });
        give(splats);
    }
}

/** Brings an object to where its file says. */
function placed(splats: LitetexSplats): LitetexSplats {
    new Matrix4().fromArray([...splats.info.worldFromData]).decompose(splats.position, splats.quaternion, splats.scale);
    splats.name = splats.info.provenance.title;
    return splats;
}

/** Reads a file as an object in the frame of the data; see `readInto`. */
export function loadSplats(source: Source, options: SplatsOptions, onUpdate?: (splats: LitetexSplats, update: SplatUpdate) => boolean): Promise<LitetexSplats> {
    return readInto(source, (info) => new LitetexSplats(info, options), options.maxSplats, onUpdate);
}
