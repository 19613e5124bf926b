import { check } from './errors';

/** Milliseconds of work after which others get their turn. */
const TURN_MS = 12;

/** Bytes of a file that arrive in pieces and are taken in order. Memory follows what has arrived, never what is asked for. */
export class Source {
    /** Bytes that have arrived, and those of them that have been taken. */
    arrived = 0;
    taken = 0;
    /** Whether bytes are waited for. */
    isWaiting = false;
    /** Called before that. */
    onWait = (): void => {};
    private pieces: Uint8Array[] = [];
    private turn = performance.now();

    /** `next` gives the next piece, or null at the end of the file. */
    constructor(
        private readonly next: () => Promise<Uint8Array | null>,
        private readonly signal: AbortSignal | undefined,
    ) {}

    /** The next bytes, which stay; fewer at the end of the file. */
    async peek(count: number): Promise<Uint8Array> {
        while (this.arrived - this.taken < count && (await this.pull()));
        const [first = new Uint8Array(0), ...others] = this.pieces;
        if (first.length >= count || others.length === 0) return first.subarray(0, count);
        const all = new Uint8Array(Math.min(count, this.arrived - this.taken));
        let at = 0;
        for (const piece of this.pieces) {
            const part = piece.subarray(0, all.length - at);
            all.set(part, at);
            at += part.length;
        }
        return all;
    }

    /** The next bytes; throws SceneError if the file ends before. */
    async take(count: number): Promise<Uint8Array> {
        const bytes = await this.peek(count);
        check(bytes.length === count, 'truncated file: bytes', this.arrived, `at least ${this.taken + count}`);
        this.drop(count);
        if (performance.now() - this.turn > TURN_MS) {
            await nextTurn();
            this.turn = performance.now();
        }
        this.signal?.throwIfAborted();
        return bytes;
    }

    /** Leaves out bytes up to a place in the file. */
    async skipTo(place: number): Promise<void> {
        for (;;) {
            this.drop(Math.min(place, this.arrived) - this.taken);
            if (this.taken === place) return;
            check(await this.pull(), 'truncated file: bytes', this.arrived, `at least ${place}`);
        }
    }

    private async pull(): Promise<boolean> {
        this.onWait();
        this.isWaiting = true;
        const piece = await this.next();
        this.isWaiting = false;
        this.signal?.throwIfAborted();
        if (piece === null) return false;
        this.pieces.push(plain(piece));
        this.arrived += piece.length;
        return true;
    }

    private drop(count: number): void {
        this.taken += count;
        let whole = 0;
        for (; count > 0 && count >= this.pieces[whole].length; whole += 1) count -= this.pieces[whole].length;
        this.pieces.splice(0, whole);
        if (count > 0) this.pieces[0] = this.pieces[0].subarray(count);
    }
}

/** Resolves when others have had their turn. Timers would do so 4 ms later: browsers slow down those that follow each other. */
function nextTurn(): Promise<void> {
    const { port1, port2 } = new MessageChannel();
    return new Promise((resolve) => {
        port1.onmessage = () => {
            port1.close();
            resolve();
        };
        port2.postMessage(null);
    });
}

/**
 * The same bytes as a Uint8Array proper. `slice` of a Buffer of Node.js shares its memory instead of copying it, and browsers
 * neither inflate nor decode memory that threads share.
 */
function plain(bytes: Uint8Array): Uint8Array {
    const { buffer, byteOffset, byteLength } = bytes;
    const same = new Uint8Array(buffer, byteOffset, byteLength);
    return buffer instanceof ArrayBuffer || Object.prototype.toString.call(buffer) === '[object ArrayBuffer]' ? same : new Uint8Array(same);
}

/** A source of all bytes at once, or of those of a stream, which is cancelled when `close` is called or `signal` aborted. */
export function openSource(
    from: ArrayBuffer | Uint8Array | ReadableStream<Uint8Array>,
    signal: AbortSignal | undefined,
): { readonly source: Source; readonly close: () => void } {
    if (!('getReader' in from)) {
        let rest: Uint8Array | null = ArrayBuffer.isView(from) ? from : new Uint8Array(from);
        const next = async (): Promise<Uint8Array | null> => {
            const all = rest;
            rest = null;
            return all;
        };
        return { source: new Source(next, signal), close: () => {} };
    }
    const reader = from.getReader();
    // A stream that has failed cannot be cancelled.
    const cancel = (): void => void reader.cancel().catch(() => {});
    signal?.addEventListener('abort', cancel);
    const close = (): void => {
        signal?.removeEventListener('abort', cancel);
        cancel();
    };
    return { source: new Source(async () => (await reader.read()).value ?? null, signal), close };
}
