import SplatWorker from './worker?worker&inline';
import type { FromWorker } from './messages';

/** Starts the worker, which sorts and reads files; null where the page allows none. */
export function startWorker(receive: (message: FromWorker) => void): Worker | null {
    if (typeof Worker === 'undefined') return null;
    try {
        const worker = new SplatWorker();
        worker.onmessage = (event: MessageEvent<FromWorker>) => receive(event.data);
        return worker;
    } catch {
        return null; // a Content-Security-Policy without worker-src blob:
    }
}
