/** A small scene that is drawn in place of the whole: while that arrives, from afar, and on weak devices. */

import type { SceneInfo, Splats } from '../scene';
import { SplatBuffers, type Storage } from './buffers';
import { Pool } from './pool';
import { Sorter } from './sort';
import type { View } from './view';

/** A stand-in on the GPU. Its splats are few, so that they are sorted here, whenever the camera turns. */
export class StandIn {
    readonly buffers: SplatBuffers;
    readonly order: Pool;
    /** Changes with the order. */
    orderVersion = 0;
    private readonly sorter = new Sorter();
    private axis = '';

    constructor(gl: WebGL2RenderingContext, info: SceneInfo, splats: Splats, storage: Storage) {
        const { count, texels, positions } = splats;
        const shDegree = splats.shDegrees.reduce((most, degree) => Math.max(most, degree), 0);
        this.buffers = new SplatBuffers(gl, { ...info, splats: count, texels: texels.length / 3, shDegree }, storage);
        const kept = this.buffers.apply({ first: 0, splats, bytes: 0, complete: true });
        this.order = new Pool(gl, 'r32ui', kept);
        this.sorter.set(0, positions.subarray(0, 3 * kept));
    }

    get bytes(): number {
        return this.buffers.bytes + this.order.bytes;
    }

    /** Puts the splats in the order of a view. */
    sort({ rotation, translation }: View): void {
        const axis = [rotation[6], rotation[7], rotation[8]] as const;
        if (this.axis === axis.join()) return;
        this.axis = axis.join();
        const order = new Uint32Array(this.buffers.count);
        this.sorter.sort({ axis, offset: translation[2] }, order);
        this.order.write(0, order);
        this.orderVersion++;
    }

    dispose(): void {
        this.buffers.dispose();
        this.order.dispose();
    }
}
