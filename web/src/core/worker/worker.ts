import { Sorter } from '../render/sort';
import type { FromWorker, ToWorker } from './messages';
import { help, Pool } from './pool';
import { readFrom } from './read-from';

const sorter = new Sorter();
const post = (message: FromWorker, transfer: Transferable[] = []) => self.postMessage(message, { transfer });
const pool = new Pool((chunks) => post({ kind: 'chunks', chunks }));

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
    switch (data.kind) {
        case 'positions':
            return sorter.set(data.first, data.xyz);
        case 'sort': {
            const start = performance.now();
            const order = new Uint32Array(sorter.count);
            sorter.sort(data.view, order);
            return post({ kind: 'order', order, generation: data.generation, ms: performance.now() - start }, [order.buffer]);
        }
        case 'read':
            return void readFrom(data.source, data.maxSplats, post, pool);
        case 'helper':
            return pool.add(data.port);
        case 'help':
            return help(data.port);
    }
};
