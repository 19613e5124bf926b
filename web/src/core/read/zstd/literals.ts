import { expect } from './bits';
import { type HuffmanTable, decodeHuffman, readHuffman } from './huffman';

/** Most bytes that a block makes. */
export const BLOCK_MAX = 1 << 17;

/** Kinds of literals. */
const RAW = 0;
const CONSTANT = 1;
const CODED = 2;

export interface Literals {
    readonly bytes: Uint8Array;
    /** Bytes that they took. */
    readonly size: number;
    /** The table for blocks that have none of their own. */
    readonly huffman: HuffmanTable | undefined;
}

/** Reads the literals at the front of a block (RFC 8878, section 3.1.1.3.1). */
export function readLiterals(block: Uint8Array, before: HuffmanTable | undefined): Literals {
    const kind = block[0] & 3;
    const format = (block[0] >> 2) & 3;
    const isPlain = kind <= CONSTANT;
    const first = isPlain ? [1, 2, 1, 3][format] : [3, 3, 4, 5][format];
    expect(block.length >= first);
    let head = 0;
    for (let i = 0; i < first; i += 1) head += block[i] * 256 ** i;
    const countBits = isPlain ? 20 : [10, 10, 14, 18][format];
    const shift = isPlain ? (format & 1 ? 4 : 3) : 4;
    const count = Math.floor(head / 2 ** shift) % 2 ** countBits;
    const size = kind === RAW ? count : kind === CONSTANT ? 1 : Math.floor(head / 2 ** (4 + countBits));
    let coded = block.subarray(first, first + size);
    expect(count <= BLOCK_MAX && coded.length === size);
    const end = first + size;
    if (kind === RAW) return { bytes: coded, size: end, huffman: before };
    const bytes = new Uint8Array(count);
    if (kind === CONSTANT) return { bytes: bytes.fill(coded[0]), size: end, huffman: before };
    let huffman = before;
    if (kind === CODED) {
        const [table, used] = readHuffman(coded);
        huffman = table;
        coded = coded.subarray(used);
    }
    expect(huffman !== undefined);
    if (format === 0) decodeHuffman(coded, huffman, bytes);
    else decodeFour(coded, huffman, bytes);
    return { bytes, size: end, huffman };
}

/** Decodes four streams, each but the last of a quarter of the bytes. */
function decodeFour(coded: Uint8Array, huffman: HuffmanTable, out: Uint8Array): void {
    const quarter = (out.length + 3) >> 2;
    let at = 6;
    for (let i = 0; i < 4; i += 1) {
        const end = i < 3 ? at + (coded[2 * i] | (coded[2 * i + 1] << 8)) : coded.length;
        decodeHuffman(coded.subarray(at, end), huffman, out.subarray(quarter * i, i < 3 ? quarter * (i + 1) : out.length));
        at = end;
    }
}
