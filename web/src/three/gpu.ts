/** A scene's textures in one renderer. They are our own, not three.js's; its caches of GL state are kept right. */

import type { WebGLRenderer } from 'three';
import { Batches } from '../core/render/batch';
import { SplatBuffers, type Storage } from '../core/render/buffers';
import { FastPath } from '../core/render/fast';
import { asGuest } from '../core/render/guest';
import { Pool } from '../core/render/pool';
import type { Frame } from '../core/render/projection';
import type { SceneInfo } from '../core/scene';
import { Composite } from './composite';
import type { CameraOrder } from './orders';

/** Textures of the fast path: records, the atlas, places in it. */
const FAST_TEXTURES = 6;
/** Orders of cameras that are kept on the GPU: enough for a view, a mirror and the six of a cube. */
const MAX_ORDERS = 8;

export interface VersionedUpdate {
    readonly version: number;
    readonly update: Parameters<SplatBuffers['apply']>[0];
}

export class GpuScene {
    readonly buffers: SplatBuffers;
    /** Another one after the loss of the context, which all textures went with. */
    readonly state: WebGLRenderer['state'];
    private readonly orders = new Map<CameraOrder, { pool: Pool; version: number; splats: number; count: number; stamp: number }>();
    private stamp = 0;
    private batches: Batches | null = null;
    private fast: FastPath | null = null;
    readonly composite: Composite;
    private version = 0;

    constructor(private readonly renderer: WebGLRenderer, info: SceneInfo, storage: Storage, maxSplats: number) {
        this.composite = new Composite(renderer);
        this.state = renderer.state;
        this.buffers = this.uploading((gl) => new SplatBuffers(gl, info, storage, maxSplats));
        renderer.info.memory.textures += 4;
    }

    /** Takes what it has not got yet. */
    apply(updates: readonly VersionedUpdate[]): void {
        const later = updates.filter(({ version }) => version > this.version);
        if (later.length === 0) return;
        this.uploading(() => later.forEach(({ update }) => this.buffers.apply(update)));
        this.version = later[later.length - 1].version;
    }

    /** The order as a texture, how many splats stand in it, and a number that changes with it. */
    order(order: CameraOrder): { pool: Pool; count: number; stamp: number } {
        let entry = this.orders.get(order);
        this.orders.delete(order); // the latest used stands last
        if (!entry) {
            if (this.orders.size >= MAX_ORDERS) this.drop(this.orders.keys().next().value!);
            const pool = this.uploading((gl) => new Pool(gl, 'r32ui', this.buffers.capacity));
            this.renderer.info.memory.textures++;
            entry = { pool, version: -1, splats: 0, count: 0, stamp: 0 };
        }
        const { count } = this.buffers;
        if (entry.version !== order.version || entry.splats !== count) {
            // Some splats may have gone since it was made, or have found no room on this device.
            const drawn = order.order.some((splat) => splat >= count) ? order.order.filter((splat) => splat < count) : order.order;
            this.uploading(() => entry.pool.write(0, drawn));
            Object.assign(entry, { version: order.version, splats: count, count: drawn.length, stamp: ++this.stamp });
        }
        this.orders.set(order, entry);
        return entry;
    }

    /** The records of an image. */
    prepare(frame: Frame): FastPath {
        if (this.fast?.has(frame)) return this.fast;
        return this.uploading((gl) => {
            if (!this.fast) this.renderer.info.memory.textures += FAST_TEXTURES;
            this.batches ??= new Batches(gl);
            this.fast ??= new FastPath(gl, this.batches);
            this.fast.prepare(frame);
            return this.fast;
        });
    }

    dispose(): void {
        [...this.orders.keys()].forEach((order) => this.drop(order));
        this.renderer.info.memory.textures -= this.fast ? 4 + FAST_TEXTURES : 4;
        const alive = this.state === this.renderer.state;
        this.composite.dispose(alive);
        if (!alive) return;
        this.buffers.dispose();
        this.fast?.dispose();
        this.batches?.dispose();
    }

    private drop(order: CameraOrder): void {
        if (this.state === this.renderer.state) this.orders.get(order)!.pool.dispose();
        this.orders.delete(order);
        this.renderer.info.memory.textures--;
    }

    private uploading<T>(work: (gl: WebGL2RenderingContext) => T): T {
        const gl = this.renderer.getContext() as WebGL2RenderingContext;
        return asGuest(gl, () => work(gl));
    }
}
