/** Workers that decode blocks for one that reads a file. */

import { type Helpers, type Job, type Part, decoded } from '../read/ltgs/job';
import { buffersOf, errorOf, type Failed, failureOf } from './messages';

/** Jobs that a helper has at a time: one that it works on, and those until the reader, which decodes itself, looks again. */
const JOBS = 3;

/** What a helper says: that it is there, or what it has made of a job; in the order of the jobs. */
type Answer = 'ready' | { kind: 'part'; part: Part } | Failed;

/** The side of the reader. */
export class Pool implements Helpers {
    private readonly helpers: Helper[] = [];

    /** `call` asks for helpers with a number of chunks; they are added once they are there. */
    constructor(readonly call: (chunks: number) => void) {}

    /** Takes the port of a helper, which is not relied on before it has answered. */
    add(port: MessagePort): void {
        const helper = new Helper(port, () => this.helpers.push(helper));
    }

    decode(job: Job): Promise<Part> | null {
        const helper = this.helpers.reduce<Helper | null>((best, other) => (other.jobs < (best?.jobs ?? JOBS) ? other : best), null);
        return helper && helper.decode(job);
    }
}

class Helper {
    private readonly waiting: { resolve(part: Part): void; reject(error: Error): void }[] = [];

    constructor(private readonly port: MessagePort, onReady: () => void) {
        port.onmessage = ({ data }: MessageEvent<Answer>) => {
            if (data === 'ready') return onReady();
            const { resolve, reject } = this.waiting.shift()!;
            if (data.kind === 'part') resolve(data.part);
            else reject(errorOf(data));
        };
    }

    get jobs(): number {
        return this.waiting.length;
    }

    decode(job: Job): Promise<Part> {
        // A copy: it may be a part of all that has arrived.
        const data = job.data.slice();
        this.port.postMessage({ ...job, data }, [data.buffer]);
        return new Promise((resolve, reject) => this.waiting.push({ resolve, reject }));
    }
}

/** The side of a helper. */
export function help(port: MessagePort): void {
    port.onmessage = ({ data }: MessageEvent<Job>) => {
        try {
            const part = decoded(data);
            port.postMessage({ kind: 'part', part } satisfies Answer, buffersOf(part));
        } catch (error) {
            port.postMessage(failureOf(error) satisfies Answer);
        }
    };
    port.postMessage('ready' satisfies Answer);
}
