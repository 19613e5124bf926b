import SplatWorker from './worker?worker&inline';
import type { FromWorker, Source } from './messages';

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

/** Asks a worker to read a file. Bytes are handed over: the caller's array is empty then. */
export function startReading(worker: Worker | null, source: Source, maxSplats: number): void {
    // The worker has an address of its own, to which relative ones would be relative.
    const absolute = 'url' in source ? { url: new URL(source.url, document.baseURI).href } : source;
    worker?.postMessage({ kind: 'read', source: absolute, maxSplats }, 'bytes' in source ? [source.bytes] : []);
}
