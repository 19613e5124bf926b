/** A scene's textures in one renderer. They are our own, not three.js's; its caches of GL state are kept right. */

import type { WebGLRenderer } from 'three';
import { type Precision, SplatBuffers } from '../core/render/buffers';
import { Pool } from '../core/render/pool';
import type { SceneInfo } from '../core/scene';
import { Composite } from './composite';
import type { CameraOrder } from './orders';

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
    private readonly orders = new Map<CameraOrder, { pool: Pool; version: number; splats: number; count: number }>();
    readonly composite: Composite;
    private version = 0;

    constructor(private readonly renderer: WebGLRenderer, info: SceneInfo, precision: Precision, maxSplats: number) {
        this.composite = new Composite(renderer);
        this.state = renderer.state;
        this.buffers = this.uploading((gl) => new SplatBuffers(gl, info, precision, maxSplats));
        renderer.info.memory.textures += 4;
    }

    /** Takes what it has not got yet. */
    apply(updates: readonly VersionedUpdate[]): void {
        const later = updates.filter(({ version }) => version > this.version);
        if (later.length === 0) return;
        this.uploading(() => later.forEach(({ update }) => this.buffers.apply(update)));
        this.version = later[later.length - 1].version;
    }

    /** The order as a texture, and how many splats stand in it. */
    order(order: CameraOrder): { texture: WebGLTexture; count: number } {
        let entry = this.orders.get(order);
        this.orders.delete(order); // the latest used stands last
        if (!entry) {
            if (this.orders.size >= MAX_ORDERS) this.drop(this.orders.keys().next().value!);
            const pool = this.uploading((gl) => new Pool(gl, 'r32ui', this.buffers.capacity));
            this.renderer.info.memory.textures++;
            entry = { pool, version: -1, splats: 0, count: 0 };
        }
        const { count } = this.buffers;
        if (entry.version !== order.version || entry.splats !== count) {
            // Some splats may have gone since it was made, or have found no room on this device.
            const drawn = order.order.some((splat) => splat >= count) ? order.order.filter((splat) => splat < count) : order.order;
            this.uploading(() => entry.pool.write(0, drawn));
            Object.assign(entry, { version: order.version, splats: count, count: drawn.length });
        }
        this.orders.set(order, entry);
        return { texture: entry.pool.texture, count: entry.count };
    }

    dispose(): void {
        [...this.orders.keys()].forEach((order) => this.drop(order));
        this.renderer.info.memory.textures -= 4;
        const alive = this.state === this.renderer.state;
        this.composite.dispose(alive);
        if (alive) this.buffers.dispose();
    }

    private drop(order: CameraOrder): void {
        if (this.state === this.renderer.state) this.orders.get(order)!.pool.dispose();
        this.orders.delete(order);
        this.renderer.info.memory.textures--;
    }

    /** Lets `work` bind and fill textures: on unit 0, whose binding three.js forgets afterwards, and with known unpacking. */
    private uploading<T>(work: (gl: WebGL2RenderingContext) => T): T {
        const { state } = this;
        const gl = this.renderer.getContext() as WebGL2RenderingContext;
        state.activeTexture(gl.TEXTURE0);
        for (const name of [gl.UNPACK_FLIP_Y_WEBGL, gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL]) state.pixelStorei(name, false);
        for (const name of [gl.UNPACK_ROW_LENGTH, gl.UNPACK_IMAGE_HEIGHT, gl.UNPACK_SKIP_PIXELS, gl.UNPACK_SKIP_ROWS, gl.UNPACK_SKIP_IMAGES]) state.pixelStorei(name, 0);
        state.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        try {
            return work(gl);
        } finally {
            state.unbindTexture();
        }
    }
}
