import SplatWorker from './worker?worker&inline';
import type { FromWorker, StoredSource, ToWorker } from './messages';

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

/** Most workers that decode a file. */
const WORKERS_MAX = 4;
/** Chunks for each worker: a new one takes as long for its first block as for eight later ones. */
const CHUNKS_PER_WORKER = 12;

/** The workers that read a file. */
export interface Workers {
    terminate(): void;
}

/** Reads a file in a worker, which has others to help it with large files. If it cannot be had, null, or a message that it has failed. */
export function startReading(source: StoredSource, maxSplats: number, receive: (message: FromWorker) => void): Workers | null {
    const workers: (Worker | null)[] = [];
    const reader = startWorker((message) => {
        if (message.kind !== 'chunks') return receive(message);
        const most = Math.min(WORKERS_MAX, navigator.hardwareConcurrency || 1, Math.floor(message.chunks / CHUNKS_PER_WORKER));
        while (workers.length < most) workers.push(startHelper(reader!));
    });
    if (!reader) return null;
    workers.push(reader);
    reader.postMessage({ kind: 'read', source, maxSplats } satisfies ToWorker);
    return { terminate: () => workers.forEach((worker) => worker?.terminate()) };
}

/** Starts a worker that helps another. If it cannot be had, that goes on alone. */
function startHelper(reader: Worker): Worker | null {
    const helper = startWorker(() => {});
    const { port1, port2 } = new MessageChannel();
    helper?.postMessage({ kind: 'help', port: port1 } satisfies ToWorker, [port1]);
    reader.postMessage({ kind: 'helper', port: port2 } satisfies ToWorker, [port2]);
    return helper;
}
