import { check, support } from '../errors';
import { unpacked } from '../zstd';
import { signed } from './math';
import { Numbers } from './numbers';

/** Codecs of streams: bytes in a zstd frame, numbers; 0 is bytes as they are. */
const ZSTD = 1;
const NUMBERS = 2;

/** Most numbers that a byte can hold, rounded up. */
const NUMBERS_PER_BYTE = 8192;

/** Values of a context, one for each number of a stream. */
export type Contexts = Uint8Array | Uint16Array;

/** How many values contexts have. */
function valuesOf(contexts?: Contexts): number {
    let most = -1;
    contexts?.forEach((value) => {
        most = Math.max(most, value);
    });
    return most + 1;
}

/** One reader for all streams of numbers, which are read one after the other. */
const shared = new Numbers();

/** The streams of a block, one after the other (`ltgs.md`, section 2). */
export class Block {
    private at = 0;

    constructor(private readonly data: Uint8Array) {}

    /** Checks that nothing follows. */
    end(): void {
        check(this.at === this.data.length, 'bytes of a block', this.data.length, this.at);
    }

    /** The bytes of a stream of exactly `count`. */
    bytes(count: number): Uint8Array {
        const [codec, , coded] = this.stream(count, false);
        support(codec < NUMBERS, 'codec of bytes', codec, '0 or 1');
        if (codec === ZSTD && count > 0) return unpacked(coded, count);
        check(coded.length === count, 'bytes of a stream', coded.length, count);
        return coded;
    }

    /**
     * Begins a stream of `count` numbers, of which the caller reads all before it calls `end`; null for one without numbers.
     * `second` and `third`: see {@link Numbers.start}. `orNone`: whether there may be none instead.
     */
    begin(count: number, second: number, third: number, orNone = false): Numbers | null {
        const [codec, found, coded] = this.stream(count, orNone);
        support(codec === NUMBERS, 'codec of numbers', codec, NUMBERS);
        if (found === 0) return null;
        check(count <= NUMBERS_PER_BYTE * (coded.length + 1), `numbers in ${coded.length} bytes`, count, 'fewer');
        shared.start(coded, second, third);
        return shared;
    }

    /** Reads numbers, given the values of their further contexts; zeros if there may be none. */
    numbers(count: number, second?: Contexts, third?: Contexts, orNone = false): Uint32Array {
        const stream = this.begin(count, valuesOf(second), valuesOf(third), orNone);
        const out = new Uint32Array(count);
        if (stream === null) return out;
        for (let i = 0; i < count; i += 1) out[i] = stream.next(second ? second[i] : 0, third ? third[i] : 0);
        stream.end();
        return out;
    }

    /** Reads signed numbers in the same way. */
    signed(count: number, contexts?: Contexts, orNone = false): Int32Array {
        return new Int32Array(this.numbers(count, contexts, undefined, orNone).buffer).map(signed);
    }

    private stream(count: number, orNone: boolean): [codec: number, found: number, coded: Uint8Array] {
        const codec = this.data[this.at++] ?? NUMBERS;
        support(codec <= NUMBERS, 'codec', codec, '0 to 2');
        const found = this.varint();
        const size = this.varint();
        check(found === count || (orNone && found === 0), 'values of a stream', found, `${count}${orNone ? ' or none' : ''}`);
        check(found > 0 || size === 0, 'bytes of a stream without values', size, 0);
        this.at += size;
        check(this.at <= this.data.length, 'bytes of a stream', size, `at most the ${this.data.length} of its block`);
        return [codec, found, this.data.subarray(this.at - size, this.at)];
    }

    /** A number, rounded above 2^53. */
    private varint(): number {
        let value = 0;
        for (let scale = 1; scale < 2 ** 64; scale *= 128) {
            check(this.at < this.data.length, 'bytes of a block', this.data.length, 'more');
            const byte = this.data[this.at];
            this.at += 1;
            value += (byte & 127) * scale;
            if (byte < 128) return value;
        }
        check(false, 'count of a stream', value, 'at most 64 bits');
    }
}
