import type { SplatUpdate, Splats } from '../../scene';
import { checkSplats } from '../check';
import { concatenate, firstOf } from '../splats';
import { type Geometry, splatsOf } from './chunk';
import type { Part } from './job';

/** The part of a layer's chunks that justifies an update that gives splats again. */
const SHARE = 1 / 8;

/** What is there of a chunk. */
interface Arriving extends Part {
    readonly geometry: Geometry;
}

/** The layer in arrival, shown as its blocks come (`ltgs.md`, section 1). */
export class Layer {
    /** Splats of the complete layer, in one or more parts. */
    parts: Splats[] = [];
    private readonly chunks: Arriving[] = [];
    /** Chunks that have been shown, the first that has changed since, and how many have. */
    private shown = 0;
    private firstChanged = Infinity;
    private changes = 0;

    /** `size`: its chunks; `first`: its first splat; `most`: splats that are wanted of it. */
    constructor(
        private readonly size: number,
        private readonly first: number,
        private readonly most: number,
        private readonly onUpdate: (update: Omit<SplatUpdate, 'bytes'>) => void,
    ) {}

    /** Adds a block of a chunk: its geometry first, and that of the chunks before. */
    add(chunk: number, part: Part): void {
        if (chunk < this.chunks.length) {
            this.firstChanged = Math.min(this.firstChanged, chunk);
            this.changes += 1;
        }
        this.chunks[chunk] = { ...this.chunks[chunk], ...part };
    }

    /** Shows new chunks, and those that have changed where they are many, or where nothing follows. */
    show(isLast: boolean): void {
        const { chunks } = this;
        const isNew = chunks.length > this.shown;
        if (!isNew && this.changes < (isLast ? 1 : SHARE * this.size)) return;
        const from = Math.min(this.shown, this.firstChanged);
        const before = chunks.slice(0, from).reduce((sum, { geometry }) => sum + geometry.count, 0);
        this.parts = chunks.map(({ geometry, sh, texels }, i) => (i < from ? this.parts[i] : splatsOf(geometry, sh, texels)));
        const own = this.parts.slice(from);
        own.forEach(checkSplats);
        const splats = concatenate(own);
        const complete = chunks.slice(from).every(({ texels }) => texels !== undefined);
        // The same memory where it can be.
        if (from === 0 && complete && isLast) this.parts = [splats];
        this.onUpdate({ first: this.first + before, splats: firstOf(splats, this.most - before), complete });
        this.shown = chunks.length;
        this.firstChanged = Infinity;
        this.changes = 0;
    }
}
