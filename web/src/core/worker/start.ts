import SplatWorker from './worker?worker&inline';
import type { FromWorker, StoredSource } from './messages';

const REFUSED = "this page lets no worker start: its Content-Security-Policy must allow worker-src blob:";

/** Starts the worker, which sorts and reads files. If it cannot be had, null, or a message that it has failed. */
export function startWorker(receive: (message: FromWorker) => void): Worker | null {
    if (typeof Worker === 'undefined') return null;
    try {
        const worker = new SplatWorker();
        worker.onmessage = (event: MessageEvent<FromWorker>) => receive(event.data);
        worker.onerror = (event) => receive({ kind: 'failed', errorKind: null, message: event.message || REFUSED });
        return worker;
    } catch {
        receive({ kind: 'failed', errorKind: null, message: REFUSED });
        return null;
    }
}

/** Asks a worker to read a file. */
export function startReading(worker: Worker | null, source: StoredSource, maxSplats: number): void {
    worker?.postMessage({ kind: 'read', source, maxSplats });
}
