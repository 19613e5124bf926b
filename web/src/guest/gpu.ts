/** A scene's textures in a context of another engine. They are our own; the engine's caches of GL state are kept right. */

import { Batches } from '../core/render/batch';
import { SplatBuffers, type Storage } from '../core/render/buffers';
import { FastPath } from '../core/render/fast';
import { asGuest } from '../core/render/guest';
import { Pool } from '../core/render/pool';
import type { Frame } from '../core/render/projection';
import type { SceneInfo } from '../core/scene';
import type { CameraOrder } from './orders';

/** Textures of the fast path: records, the atlas, places in it. */
const FAST_TEXTURES = 6;
/** Orders of cameras that are kept on the GPU: enough for a view, a mirror and the six of a cube. */
const MAX_ORDERS = 8;

export interface Context {
    readonly gl: WebGL2RenderingContext;
    /** Whether it still has what was made in it: not once it has been lost. */
    alive(): boolean;
    /** Is told how many textures were made or, below zero, deleted. */
    counted(textures: number): void;
    /** Frees what the engine's own part has made. */
    dispose(): void;
}

export interface VersionedUpdate {
    readonly version: number;
    readonly update: Parameters<SplatBuffers['apply']>[0];
}

export class GpuScene {
    readonly buffers: SplatBuffers;
    private readonly orders = new Map<CameraOrder, { pool: Pool; version: number; splats: number; count: number; stamp: number }>();
    private stamp = 0;
    private batches: Batches | null = null;
    private fast: FastPath | null = null;
    private version = 0;

    constructor(private readonly context: Context, info: SceneInfo, storage: Storage, maxSplats: number) {
        this.buffers = this.uploading((gl) => new SplatBuffers(gl, info, storage, maxSplats));
        context.counted(4);
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
            this.context.counted(1);
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
            if (!this.fast) this.context.counted(FAST_TEXTURES);
            this.batches ??= new Batches(gl);
            this.fast ??= new FastPath(gl, this.batches);
            this.fast.prepare(frame);
            return this.fast;
        });
    }

    dispose(): void {
        [...this.orders.keys()].forEach((order) => this.drop(order));
        this.context.counted(this.fast ? -4 - FAST_TEXTURES : -4);
        this.buffers.dispose();
        this.fast?.dispose();
        this.batches?.dispose();
    }

    private drop(order: CameraOrder): void {
        this.orders.get(order)!.pool.dispose();
        this.orders.delete(order);
        this.context.counted(-1);
    }

    private uploading<T>(work: (gl: WebGL2RenderingContext) => T): T {
        const { gl } = this.context;
        return asGuest(gl, () => work(gl));
    }
}
