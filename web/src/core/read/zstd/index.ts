import { viewOf } from '../bytes';
import { check } from '../errors';
import { expect } from './bits';
import { BLOCK_MAX, readLiterals } from './literals';
import { Sequences } from './sequences';
import type { HuffmanTable } from './huffman';

/** Most bytes that a coded byte stands for: 128 KiB from a block of 4 bytes. */
const EXPANSION_MAX = 1 << 15;

const MAGIC = 0xfd2fb528;

/** Kinds of blocks. */
const CONSTANT = 1;
const COMPRESSED = 2;

/**
 * Decompresses one zstd frame (RFC 8878) of exactly `count` bytes, which bound memory and time whatever the frame says. It may
 * repeat bytes of `dictionary`, as if they stood before its own.
 * Checksums of frames are not checked: xxh3-64 covers all that is read here.
 */
export function unpacked(coded: Uint8Array, count: number, dictionary = new Uint8Array()): Uint8Array {
    check(count <= EXPANSION_MAX * (coded.length + 1), `zstd: bytes from ${coded.length} coded ones`, count, 'fewer');
    let at = headerBytes(coded, count);
    const end = coded.length - (coded[4] & 4);
    const sequences = new Sequences(new Uint8Array(dictionary.length + count));
    sequences.append(dictionary);
    let huffman: HuffmanTable | undefined;
    for (let isLast = 0; isLast === 0; ) {
        expect(at + 3 <= end);
        isLast = coded[at] & 1;
        const kind = (coded[at] >> 1) & 3;
        const size = (coded[at] | (coded[at + 1] << 8) | (coded[at + 2] << 16)) >> 3;
        const stored = kind === CONSTANT ? 1 : size;
        at += 3 + stored;
        expect(size <= BLOCK_MAX && at <= end && kind <= COMPRESSED);
        const block = coded.subarray(at - stored, at);
        if (kind === COMPRESSED) {
            const literals = readLiterals(block, huffman);
            huffman = literals.huffman;
            sequences.decode(block.subarray(literals.size), literals.bytes);
        } else {
            sequences.append(kind === CONSTANT ? new Uint8Array(size).fill(block[0]) : block);
        }
    }
    expect(at === end);
    return sequences.done().subarray(dictionary.length);
}

/** Bytes of the frame's header (section 3.1.1.1). */
function headerBytes(coded: Uint8Array, count: number): number {
    expect(coded.length > 8 && viewOf(coded).getUint32(0, true) === MAGIC);
    const flags = coded[4];
    const isSingle = (flags & 32) !== 0;
    // No number of a dictionary, and no bit that is reserved.
    expect((flags & 11) === 0);
    const sizeBytes = [isSingle ? 1 : 0, 2, 4, 8][flags >> 6];
    const first = isSingle ? 5 : 6;
    let stated = sizeBytes === 2 ? 256 : 0;
    for (let i = first; i < first + sizeBytes; i += 1) stated += coded[i] * 256 ** (i - first);
    check(sizeBytes === 0 || stated === count, 'zstd: bytes of a frame', stated, count);
    return first + sizeBytes;
}
