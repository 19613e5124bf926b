/** What the objects that show the same scene in an engine share: its splats, their orders, and textures in each context. */

import type { Storage } from '../core/render/buffers';
import type { SceneInfo, Splats, SplatUpdate } from '../core/scene';
import { type Context, GpuScene, type VersionedUpdate } from './gpu';
import { Orders } from './orders';

export interface SplatsOptions {
    /** Shows at most this many splats, the first ones, which contribute most in files with layers. Default: all. */
    readonly maxSplats?: number;
    /** Bits of colours and texels on the GPU: `half` (default) or `full`. */
    readonly storage?: Storage;
}

export class SplatData<Host extends Context = Context> {
    readonly orders: Orders;
    /** Objects that show it. */
    private readonly users = new Map<object, () => void>();
    private readonly gpus = new Map<object, { readonly host: Host; readonly gpu: GpuScene }>();
    private updates: VersionedUpdate[] = [];
    private version = 0;
    disposed = false;

    constructor(readonly info: SceneInfo, readonly options: SplatsOptions) {
        this.orders = new Orders(() => this.changed());
    }

    get maxSplats(): number {
        return this.options.maxSplats ?? Infinity;
    }

    /** Splats that are there. */
    get count(): number {
        const last = this.updates[this.updates.length - 1]?.update;
        return last ? last.first + last.splats.count : 0;
    }

    /** Splats, part by part, with the index of the first of each. Their arrays may be longer than their `count` says. */
    get parts(): readonly { readonly first: number; readonly splats: Splats }[] {
        return this.updates.map(({ update }) => update);
    }

    apply(update: SplatUpdate): void {
        if (this.disposed) return; // the rest of a file that nobody wants any more
        const { first } = update;
        const splats = shortened(update.splats, this.maxSplats - first);
        // A part that reaches beyond the first of the new ones loses its end.
        const kept = this.updates.filter((old) => old.update.first < first).map((old) => {
            const part = old.update;
            return { ...old, update: { ...part, splats: shortened(part.splats, first - part.first) } };
        });
        this.updates = [...kept, { version: ++this.version, update: { ...update, splats } }];
        this.orders.setPositions(first, splats.positions.subarray(0, 3 * splats.count));
        this.changed();
    }

    /** The textures of a context, up to date. `key` stands for it, and is another one after its loss. */
    gpu(key: object, makeHost: () => Host): { readonly host: Host; readonly gpu: GpuScene } {
        let made = this.gpus.get(key);
        if (!made) {
            for (const [old, { host }] of this.gpus) if (!host.alive()) this.gpus.delete(old);
            const host = makeHost();
            made = { host, gpu: new GpuScene(host, this.info, this.options.storage ?? 'half', this.maxSplats) };
            this.gpus.set(key, made);
        }
        made.gpu.apply(this.updates);
        return made;
    }

    /** Counts an object that shows it and is told about changes. */
    retain(user: object, changed: () => void): void {
        this.users.set(user, changed);
    }

    /** Frees everything when no object shows it any more. */
    release(user: object): void {
        if (!this.users.delete(user) || this.users.size > 0) return;
        this.disposed = true;
        this.gpus.forEach(({ host, gpu }) => {
            if (!host.alive()) return;
            gpu.dispose();
            host.dispose();
        });
        this.gpus.clear();
        this.orders.dispose();
        this.updates = [];
    }

    private changed(): void {
        [...this.users.values()].forEach((changed) => changed());
    }
}

function shortened(splats: Splats, most: number): Splats {
    return { ...splats, count: Math.max(0, Math.min(splats.count, most)) };
}
