import { bitsAt } from '../bytes';
import { type BackwardBits, expect } from './bits';

/** A table of finite state entropy: for each state a symbol, and the states that may follow (RFC 8878, section 4.1). */
export interface FseTable {
    readonly log: number;
    readonly symbols: Uint8Array;
    readonly bits: Uint8Array;
    readonly bases: Uint16Array;
}

const floorLog2 = (x: number): number => 31 - Math.clz32(x);

/** The table of symbols with these probabilities, in 2^-log; -1 stands for less than 1. */
export function fseTable(probabilities: readonly number[], log: number): FseTable {
    const size = 1 << log;
    const table = { log, symbols: new Uint8Array(size), bits: new Uint8Array(size), bases: new Uint16Array(size) };
    const next = probabilities.map(Math.abs);
    let high = size;
    probabilities.forEach((p, symbol) => {
        if (p < 0) table.symbols[(high -= 1)] = symbol;
    });
    let at = 0;
    probabilities.forEach((p, symbol) => {
        for (; p > 0; p -= 1) {
            table.symbols[at] = symbol;
            do at = (at + (size >> 1) + (size >> 3) + 3) & (size - 1);
            while (at >= high);
        }
    });
    table.symbols.forEach((symbol, state) => {
        const value = next[symbol]++;
        const bits = log - floorLog2(value);
        table.bits[state] = bits;
        table.bases[state] = (value << bits) - size;
    });
    return table;
}

/** Reads a table from the front of bytes; returns it and the bytes that it took. */
export function readFse(bytes: Uint8Array, symbols: number, logMax: number): [FseTable, number] {
    const log = bitsAt(bytes, 0, 4) + 5;
    const probabilities: number[] = [];
    let at = 4;
    let left = 1 << log;
    while (left > 0) {
        const half = 1 << floorLog2(left + 1);
        const spare = 2 * half - 2 - left;
        let value = bitsAt(bytes, at, 1 + floorLog2(half));
        at += 1 + floorLog2(half);
        if ((value & (half - 1)) < spare) {
            value &= half - 1;
            at -= 1;
        } else if (value >= half) {
            value -= spare;
        }
        probabilities.push(value - 1);
        left -= Math.abs(value - 1);
        for (let zeros = value === 1 ? 3 : 0; zeros === 3; ) {
            zeros = bitsAt(bytes, at, 2);
            at += 2;
            for (let i = 0; i < zeros; i += 1) probabilities.push(0);
            expect(at <= 8 * bytes.length);
        }
    }
    expect(log <= logMax && left === 0 && probabilities.length <= symbols && at <= 8 * bytes.length);
    return [fseTable(probabilities, log), (at + 7) >> 3];
}

/** A state of a table that moves along a stream. */
export class FseState {
    private state: number;

    constructor(
        private readonly table: FseTable,
        private readonly bits: BackwardBits,
    ) {
        this.state = bits.read(table.log);
    }

    get symbol(): number {
        return this.table.symbols[this.state];
    }

    move(): void {
        this.state = this.table.bases[this.state] + this.bits.read(this.table.bits[this.state]);
    }
}
