/** Orders of splats for any number of cameras. */

import { Sorter, type SortView } from '../core/render/sort';
import type { FromWorker, ToWorker } from '../core/worker/messages';
import { startWorker } from '../core/worker/start';

/** Least change of an axis that asks for another order. */
const AXIS_TOLERANCE = 1e-6;
/** Cosine of the angle beyond which an order is too wrong to be drawn until the worker has a better one: 10 degrees. */
const COS_FAR = Math.cos(Math.PI / 18);

/** The order of one camera. */
export class CameraOrder {
    /** Far to near. */
    order = new Uint32Array(0);
    /** Counts the orders that it has had. */
    version = 0;
    /** What the order is of. */
    shown: SortView | null = null;
    /** What it was last wanted for. */
    view: SortView | null = null;
    generation = -1;
}

export class Orders {
    private readonly sorter = new Sorter();
    private worker: Worker | null | undefined;
    private generation = 0;
    private waiting = new Map<CameraOrder, SortView>();
    private sorting: { order: CameraOrder; view: SortView } | null = null;

    /** `onOrder` is called when the worker has made an order. */
    constructor(private readonly onOrder: () => void) {}

    /** Takes the centres of splats from `first` on; what follows is dropped. */
    setPositions(first: number, xyz: Float32Array): void {
        this.generation++;
        this.sorter.set(first, xyz);
        const copy = xyz.slice();
        this.post({ kind: 'positions', first, xyz: copy }, [copy.buffer]);
    }

    /**
     * Brings an order up to date: at once if it is new or more than 10 degrees off, if `immediate`, or where there is no
     * worker; else in the worker, and until then the order of before stands.
     */
    update(order: CameraOrder, view: SortView, immediate: boolean): void {
        if (order.generation === this.generation && near(order.view!, view) && !(immediate && this.pending(order))) return;
        if (!order.shown || immediate || !this.worker || dot(order.shown, view) < COS_FAR) {
            order.order = new Uint32Array(this.sorter.count);
            this.sorter.sort(view, order.order);
            order.shown = view;
            order.version++;
            this.waiting.delete(order);
        } else {
            this.waiting.set(order, view);
        }
        order.view = view;
        order.generation = this.generation;
        this.next();
    }

    dispose(): void {
        this.worker?.terminate();
        this.worker = null;
        this.waiting.clear();
        this.sorter.set(0, new Float32Array(0));
    }

    private pending(order: CameraOrder): boolean {
        return this.sorting?.order === order || this.waiting.has(order);
    }

    private next(): void {
        const first = this.waiting.entries().next();
        if (this.sorting || first.done) return;
        const [order, view] = first.value;
        this.waiting.delete(order);
        this.sorting = { order, view };
        this.post({ kind: 'sort', view, generation: order.version }, []);
    }

    private post(message: ToWorker, transfer: Transferable[]): void {
        if (this.worker === undefined) this.worker = startWorker((answer) => this.receive(answer));
        this.worker?.postMessage(message, transfer);
    }

    private receive(message: FromWorker): void {
        if (message.kind === 'failed') {
            // The page lets no worker start: from now on orders are made here.
            this.worker = null;
            this.sorting = null;
            this.waiting.clear();
            this.generation++;
            this.onOrder();
        }
        if (message.kind !== 'order' || !this.sorting) return;
        const { order, view } = this.sorting;
        this.sorting = null;
        // Since then the camera may have been sorted at once.
        if (message.generation === order.version) {
            order.order = message.order as Uint32Array<ArrayBuffer>;
            order.shown = view;
            order.version++;
            this.onOrder();
        }
        this.next();
    }
}

function dot(a: SortView, b: SortView): number {
    return a.axis[0] * b.axis[0] + a.axis[1] * b.axis[1] + a.axis[2] * b.axis[2];
}

function near(a: SortView, b: SortView): boolean {
    return a.axis.every((value, i) => Math.abs(value - b.axis[i]) <= AXIS_TOLERANCE);
}
