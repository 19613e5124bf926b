import { BackwardBits, expect } from './bits';
import { FseState, type FseTable, fseTable, readFse } from './fse';

const repeated = (value: number, count: number): number[] => new Array<number>(count).fill(value);

/** Extra bits by code of a length; its base follows all values of the codes before. */
const LITERAL_BITS = [...repeated(0, 16), 1, 1, 1, 1, 2, 2, 3, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];
const MATCH_BITS = [...repeated(0, 32), 1, 1, 1, 1, 2, 2, 3, 3, 4, 4, 5, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16];
const basesOf = (bits: number[], first: number): number[] => bits.map((count) => (first += 1 << count) - (1 << count));
const LITERAL_BASES = basesOf(LITERAL_BITS, 0);
const MATCH_BASES = basesOf(MATCH_BITS, 3);

/** Largest code of an offset: 2^28 is more than a stream of bytes has. */
const OFFSET_MAX = 28;

/** Of literal lengths, offsets and match lengths: how many codes there are, and the most bits of a state. */
const CODES = [36, OFFSET_MAX + 1, 53];
const LOGS_MAX = [9, 8, 9];

/** Tables that a block can name (RFC 8878, appendix A). */
const NAMED_TABLES = [
    fseTable([4, 3, ...repeated(2, 11), 1, 1, 1, ...repeated(2, 9), 3, 2, 1, 1, 1, 1, 1, -1, -1, -1, -1], 6),
    fseTable([...repeated(1, 6), 2, 2, 2, ...repeated(1, 15), -1, -1, -1, -1, -1], 5),
    fseTable([1, 4, 3, ...repeated(2, 6), ...repeated(1, 37), ...repeated(-1, 7)], 6),
];

/** Kinds of tables. */
const NAMED = 0;
const CONSTANT = 1;
const OWN = 2;

/** Appends literals and repetitions to bytes (RFC 8878, section 3.1.1.3.2). */
export class Sequences {
    /** Bytes that are there. */
    private at = 0;
    private readonly tables: FseTable[] = [];
    private readonly offsets = [1, 4, 8];

    constructor(private readonly out: Uint8Array) {}

    append(bytes: Uint8Array): void {
        expect(bytes.length <= this.out.length - this.at);
        this.out.set(bytes, this.at);
        this.at += bytes.length;
    }

    /** All bytes. */
    done(): Uint8Array {
        expect(this.at === this.out.length);
        return this.out;
    }

    /** Decodes the sequences of a block. */
    decode(block: Uint8Array, literals: Uint8Array): void {
        let at = 1;
        let count = block[0];
        if (count === 255) {
            count = (block[1] | (block[2] << 8)) + 0x7f00;
            at = 3;
        } else if (count > 127) {
            count = ((count - 128) << 8) | block[1];
            at = 2;
        }
        if (count === 0) {
            expect(block.length === at);
            this.append(literals);
            return;
        }
        const kinds = block[at];
        expect((kinds & 3) === 0);
        at += 1;
        for (let i = 0; i < 3; i += 1) at += this.readTable(i, (kinds >> (6 - 2 * i)) & 3, block.subarray(at));
        const used = this.run(new BackwardBits(block.subarray(at)), count, literals);
        this.append(literals.subarray(used));
    }

    /** Reads one of the three tables, unless it is known; returns the bytes that it took. */
    private readTable(i: number, kind: number, bytes: Uint8Array): number {
        let size = 0;
        if (kind === NAMED) {
            this.tables[i] = NAMED_TABLES[i];
        } else if (kind === CONSTANT) {
            expect(bytes[0] < CODES[i]);
            this.tables[i] = { log: 0, symbols: bytes.slice(0, 1), bits: Uint8Array.of(0), bases: Uint16Array.of(0) };
            size = 1;
        } else if (kind === OWN) {
            [this.tables[i], size] = readFse(bytes, CODES[i], LOGS_MAX[i]);
        }
        return size;
    }

    /** Carries out sequences; returns how many literals they took. */
    private run(bits: BackwardBits, count: number, literals: Uint8Array): number {
        const { out, tables } = this;
        expect(tables[0] !== undefined && tables[1] !== undefined && tables[2] !== undefined);
        const [ofLiterals, ofOffsets, ofMatches] = tables.map((table) => new FseState(table, bits));
        let used = 0;
        for (; count > 0; count -= 1) {
            const code = ofOffsets.symbol;
            const value = (1 << code) + bits.read(code);
            const match = MATCH_BASES[ofMatches.symbol] + bits.read(MATCH_BITS[ofMatches.symbol]);
            const own = LITERAL_BASES[ofLiterals.symbol] + bits.read(LITERAL_BITS[ofLiterals.symbol]);
            const offset = this.offsetOf(value, own);
            if (count > 1) {
                ofLiterals.move();
                ofMatches.move();
                ofOffsets.move();
            }
            expect(own <= literals.length - used && bits.left >= 0);
            this.append(literals.subarray(used, used + own));
            used += own;
            const end = this.at + match;
            expect(offset <= this.at && offset > 0 && end <= out.length);
            for (let i = this.at; i < end; i += 1) out[i] = out[i - offset];
            this.at = end;
        }
        expect(bits.left === 0);
        return used;
    }

    /** The offset that a value stands for, which may be one of the three last ones (section 3.1.1.5). */
    private offsetOf(value: number, literals: number): number {
        const { offsets } = this;
        const place = value > 3 ? 3 : value - (literals > 0 ? 1 : 0);
        const offset = value > 3 ? value - 3 : place === 3 ? offsets[0] - 1 : offsets[place];
        if (place > 1) offsets[2] = offsets[1];
        if (place > 0) offsets[1] = offsets[0];
        offsets[0] = offset;
        return offset;
    }
}
