import { BackwardBits, expect } from './bits';
import { FseState, readFse } from './fse';

/** A table of Huffman codes: for the next `log` bits the symbol, and 256 times the bits that it takes. */
export interface HuffmanTable {
    readonly log: number;
    readonly entries: Uint16Array;
}

/** Longest code, bits. */
const LOG_MAX = 11;

/** Reads a table from the front of bytes; returns it and the bytes that it took (RFC 8878, section 4.2.1). */
export function readHuffman(bytes: Uint8Array): [HuffmanTable, number] {
    const head = bytes[0];
    const size = head < 128 ? head : (head - 126) >> 1;
    const coded = bytes.subarray(1, 1 + size);
    expect(coded.length === size && size > 0);
    const plain = (_: unknown, i: number): number => (i & 1 ? coded[i >> 1] & 15 : coded[i >> 1] >> 4);
    return [tableOf(head < 128 ? codedWeights(coded) : Array.from({ length: head - 127 }, plain)), 1 + size];
}

function codedWeights(bytes: Uint8Array): number[] {
    const [table, size] = readFse(bytes, 16, 6);
    const bits = new BackwardBits(bytes.subarray(size));
    let [state, other] = [new FseState(table, bits), new FseState(table, bits)];
    const weights: number[] = [];
    // Both states take turns until the bits are spent; the other one tells the last weight.
    while (bits.left >= 0 && weights.length < 256) {
        weights.push(state.symbol);
        state.move();
        [state, other] = [other, state];
    }
    return [...weights, state.symbol];
}

function tableOf(weights: number[]): HuffmanTable {
    const sum = weights.reduce((total, weight) => total + ((1 << weight) >> 1), 0);
    const log = 32 - Math.clz32(sum);
    const rest = (1 << log) - sum;
    expect(sum > 0 && log <= LOG_MAX && (rest & (rest - 1)) === 0 && weights.length < 256);
    // What is left is the last symbol's.
    weights.push(32 - Math.clz32(rest));
    const entries = new Uint16Array(1 << log);
    let at = 0;
    for (let weight = 1; weight <= log; weight += 1) {
        weights.forEach((own, symbol) => {
            if (own === weight) entries.fill(symbol | ((log + 1 - weight) << 8), at, (at += 1 << (weight - 1)));
        });
    }
    return { log, entries };
}

/** Decodes a stream of codes that makes exactly as many bytes as `out` has. */
export function decodeHuffman(bytes: Uint8Array, { log, entries }: HuffmanTable, out: Uint8Array): void {
    const bits = new BackwardBits(bytes);
    for (let i = 0; i < out.length; i += 1) {
        const entry = entries[bits.peek(log)];
        out[i] = entry;
        bits.left -= entry >> 8;
    }
    expect(bits.left === 0);
}
