/** Keeps splats sorted for the camera, in a worker where one can be had, else here. */

import type { FromWorker, ToWorker } from '../worker/messages';
import { startWorker } from '../worker/start';
import { Sorter, type SortView } from './sort';
import type { View } from './view';

/** Least change of the camera's axis that asks for another order: 0.1 degrees would show; this does not. */
const AXIS_TOLERANCE = 1e-6;

export class Order {
    private worker: Worker | null;
    /** Has the centres, too, so that it can take over from a worker that fails: the page may let none start, or memory be short. */
    private readonly sorter = new Sorter();
    private sorted: SortView | null = null;
    private wanted: SortView | null = null;
    private busy = false;
    private generation = 0;
    private waiting: (() => void)[] = [];
    /** Milliseconds of the last sort. */
    lastMs = 0;

    /** `onOrder` gets a new order, far to near, of all splats. */
    constructor(private readonly onOrder: (order: Uint32Array) => void) {
        this.worker = startWorker((message) => this.receive(message));
    }

    /** Takes the centres of splats from `first` on; what follows is dropped. The next request sorts them. */
    setPositions(first: number, xyz: Float32Array): void {
        this.generation++;
        this.sorted = null;
        this.sorter.set(first, xyz);
        if (!this.worker) return;
        const copy = xyz.slice();
        this.post({ kind: 'positions', first, xyz: copy }, [copy.buffer]);
    }

    /** Centres of all splats: x, y, z of each. */
    get centres(): Float32Array {
        return this.sorter.centres;
    }

    /** Asks for the order of a view. Translation alone changes no order. */
    request(view: View): void {
        const wanted: SortView = { axis: [view.rotation[6], view.rotation[7], view.rotation[8]], offset: view.translation[2] };
        const last = this.wanted ?? this.sorted;
        if (last && wanted.axis.every((a, i) => Math.abs(a - last.axis[i]) <= AXIS_TOLERANCE)) return;
        this.wanted = wanted;
        this.next();
    }

    /** Resolves when all requests are answered. */
    settled(): Promise<void> {
        return this.busy || this.wanted ? new Promise((resolve) => this.waiting.push(resolve)) : Promise.resolve();
    }

    dispose(): void {
        this.worker?.terminate();
        this.wanted = null;
        this.busy = false;
        this.waiting.splice(0).forEach((resolve) => resolve());
    }

    private next(): void {
        if (this.busy || !this.wanted) return;
        this.sorted = this.wanted;
        this.wanted = null;
        if (this.worker) {
            this.busy = true;
            this.post({ kind: 'sort', view: this.sorted, generation: this.generation }, []);
        } else {
            const start = performance.now();
            const order = new Uint32Array(this.sorter.count);
            this.sorter.sort(this.sorted, order);
            this.lastMs = performance.now() - start;
            this.onOrder(order);
        }
    }

    private post(message: ToWorker, transfer: Transferable[]): void {
        this.worker!.postMessage(message, transfer);
    }

    private receive(message: FromWorker): void {
        this.busy = false;
        if (message.kind === 'failed') {
            this.worker?.terminate();
            this.worker = null;
            this.wanted ??= this.sorted;
        }
        if (message.kind === 'order') {
            this.lastMs = message.ms;
            // An order of splats that have changed since would be of the wrong length.
            if (message.generation === this.generation) this.onOrder(message.order);
        }
        this.next();
        if (!this.busy) this.waiting.splice(0).forEach((resolve) => resolve());
    }
}
