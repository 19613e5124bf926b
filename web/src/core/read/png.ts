import { viewOf } from './bytes';
import { check } from './errors';

/**
 * Reads PNG images of data: RGB of 8 bits, not interlaced (`gltf.md`, section 3). Image decoders of browsers may convert
 * colours.
 */

const SIGNATURE = '137,80,78,71,13,10,26,10';

/** Bytes of a pixel. */
const PIXEL = 3;

/** What deflate makes of a byte at most. */
const EXPANSION_MAX = 1040;

const CRC_TABLE = new Uint32Array(256).map((_, i) => {
    for (let bit = 0; bit < 8; bit += 1) i = (i & 1 ? 0xedb88320 : 0) ^ (i >>> 1);
    return i;
});

function crc32(bytes: Uint8Array): number {
    let c = -1;
    for (const byte of bytes) c = CRC_TABLE[(c ^ byte) & 255] ^ (c >>> 8);
    return ~c >>> 0;
}

/** Pixels of an image of this size, RGB, rows from the top. */
export async function readPng(bytes: Uint8Array, width: number, height: number): Promise<Uint8Array> {
    const data = imageData(bytes, width, height);
    const size = (1 + PIXEL * width) * height;
    check(size <= EXPANSION_MAX * bytes.length + 4096, `PNG: bytes from ${bytes.length} compressed ones`, size, 'fewer');
    return unfiltered(await inflated(data, size), width, height);
}

/** The parts of the compressed data, once all else is as expected. */
function imageData(bytes: Uint8Array, width: number, height: number): BlobPart[] {
    check(bytes.subarray(0, 8).join() === SIGNATURE, 'PNG', 'other bytes', 'its signature');
    const view = viewOf(bytes);
    const header = new DataView(new ArrayBuffer(13));
    header.setUint32(0, width);
    header.setUint32(4, height);
    // RGB of 8 bits, deflate, five filters, not interlaced.
    header.setUint16(8, 0x0802);
    const data: BlobPart[] = [];
    let at = 8;
    for (let kind = ''; kind !== 'IEND'; ) {
        check(at + 12 <= bytes.length, 'PNG', 'its end', 'IEND');
        const end = at + 8 + view.getUint32(at);
        check(end + 4 <= bytes.length, 'PNG', 'its end', 'a chunk');
        const isFirst = kind === '';
        kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
        check(crc32(bytes.subarray(at + 4, end)) === view.getUint32(end), `PNG: checksum of ${kind}`, 'another', 'that of its bytes');
        check(isFirst === (kind === 'IHDR'), 'PNG: chunk', kind, 'IHDR first, and once');
        const body = bytes.subarray(at + 8, end);
        if (isFirst) {
            const fits = body.join() === new Uint8Array(header.buffer).join();
            check(fits, 'PNG: header', body.join(), `${width} x ${height}, RGB of 8 bits, not interlaced`);
        }
        // Of the others, those of small letters may be left out.
        check(isFirst || /^(IDAT|IEND|PLTE|[a-z])/.test(kind), 'PNG: chunk', kind, 'IDAT');
        if (kind === 'IDAT') data.push(body as Uint8Array<ArrayBuffer>);
        at = end + 4;
    }
    return data;
}

/** Inflates data that make exactly `count` bytes. */
async function inflated(data: BlobPart[], count: number): Promise<Uint8Array> {
    const reader = new Blob(data).stream().pipeThrough(new DecompressionStream('deflate')).getReader();
    const out = new Uint8Array(count);
    let at = 0;
    try {
        for (let part = await reader.read(); !part.done; part = await reader.read()) {
            // More than there is room for throws.
            out.set(part.value, at);
            at += part.value.length;
        }
    } catch {
        void reader.cancel().catch(() => {});
        at = -1;
    }
    check(at === count, 'PNG: inflated bytes', at < 0 ? 'more, or damaged ones' : at, count);
    return out;
}

/** Undoes the filters of rows, each with the kind of its filter before it. */
function unfiltered(rows: Uint8Array, width: number, height: number): Uint8Array {
    const size = PIXEL * width;
    const out = new Uint8Array(size * height);
    let above = new Uint8Array(size);
    for (let y = 0; y < height; y += 1) {
        const first = y * (size + 1);
        const kind = rows[first];
        check(kind < 5, 'PNG: filter', kind, '0 to 4');
        const row = out.subarray(y * size, (y + 1) * size);
        for (let i = 0; i < size; i += 1) {
            const left = i < PIXEL ? 0 : row[i - PIXEL];
            const corner = i < PIXEL ? 0 : above[i - PIXEL];
            row[i] = rows[first + 1 + i] + predicted(kind, left, above[i], corner);
        }
        above = row;
    }
    return out;
}

function predicted(kind: number, left: number, up: number, corner: number): number {
    if (kind < 4) return kind === 0 ? 0 : kind === 1 ? left : kind === 2 ? up : (left + up) >> 1;
    const a = Math.abs(up - corner);
    const b = Math.abs(left - corner);
    const c = Math.abs(left + up - 2 * corner);
    return a <= b && a <= c ? left : b <= c ? up : corner;
}
