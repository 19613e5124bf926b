import { crc32, deflateSync } from 'node:zlib';
import { expect, test } from 'vitest';
import { readPng } from '../../src/core/read/png';
import { SceneError } from '../../src/core/scene';

const WIDTH = 7;
const HEIGHT = 10;
const pixels = Uint8Array.from({ length: 3 * WIDTH * HEIGHT }, (_, i) => (i * i * 37) % 251);

const predicted = [
    () => 0,
    (left: number) => left,
    (_: number, up: number) => up,
    (left: number, up: number) => (left + up) >> 1,
    (left: number, up: number, corner: number) => {
        const [a, b, c] = [left, up, corner].map((v) => Math.abs(left + up - corner - v));
        return a <= b && a <= c ? left : b <= c ? up : corner;
    },
];

/** Rows with their filters, which differ from row to row. */
function filtered(): Uint8Array {
    const size = 3 * WIDTH;
    const at = (y: number, i: number): number => (y < 0 || i < 0 ? 0 : pixels[y * size + i]);
    const row = (y: number): number[] => {
        const kind = y % 5;
        return [kind, ...Array.from({ length: size }, (_, i) => at(y, i) - predicted[kind](at(y, i - 3), at(y - 1, i), i < 3 ? 0 : at(y - 1, i - 3)))];
    };
    return Uint8Array.from(Array.from({ length: HEIGHT }, (_, y) => row(y)).flat());
}

function chunk(kind: string, body: Uint8Array): Buffer {
    const named = Buffer.concat([Buffer.from(kind), body]);
    const [size, crc] = [Buffer.alloc(4), Buffer.alloc(4)];
    size.writeUInt32BE(body.length);
    crc.writeUInt32BE(crc32(named));
    return Buffer.concat([size, named, crc]);
}

const header = (width = WIDTH, height = HEIGHT, rest = [8, 2, 0, 0, 0]): Buffer => {
    const body = Buffer.alloc(13);
    body.writeUInt32BE(width, 0);
    body.writeUInt32BE(height, 4);
    body.set(rest, 8);
    return chunk('IHDR', body);
};
const SIGNATURE = Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]);
const END = chunk('IEND', new Uint8Array(0));
const image = (...chunks: Buffer[]): Uint8Array => new Uint8Array(Buffer.concat([SIGNATURE, ...chunks, END]));
const data = deflateSync(filtered());
const read = (bytes: Uint8Array): Promise<Uint8Array> => readPng(bytes, WIDTH, HEIGHT);

test('all filters are undone, also in several chunks and beside others', async () => {
    expect(await read(image(header(), chunk('IDAT', data)))).toEqual(pixels);
    const parts = [chunk('gAMA', Buffer.alloc(4)), chunk('IDAT', data.subarray(0, 9)), chunk('IDAT', data.subarray(9))];
    expect(await read(image(header(), ...parts))).toEqual(pixels);
});

const flipped = (bytes: Uint8Array, at: number): Uint8Array => {
    const out = Uint8Array.from(bytes);
    out[at] ^= 1;
    return out;
};

test.each([
    ['another size', image(header(WIDTH + 1), chunk('IDAT', data))],
    ['a palette', image(header(WIDTH, HEIGHT, [8, 3, 0, 0, 0]), chunk('IDAT', data))],
    ['16 bits', image(header(WIDTH, HEIGHT, [16, 2, 0, 0, 0]), chunk('IDAT', data))],
    ['interlaced', image(header(WIDTH, HEIGHT, [8, 2, 0, 0, 1]), chunk('IDAT', data))],
    ['no header', image(chunk('IDAT', data))],
    ['two headers', image(header(), header(), chunk('IDAT', data))],
    ['an unknown chunk', image(header(), chunk('ABCD', data), chunk('IDAT', data))],
    ['too few bytes', image(header(), chunk('IDAT', deflateSync(filtered().subarray(1))))],
    ['too many bytes', image(header(), chunk('IDAT', deflateSync(Buffer.concat([filtered(), Buffer.alloc(1)]))))],
    ['a bomb', image(header(), chunk('IDAT', deflateSync(Buffer.alloc(1 << 24))))],
    ['an unknown filter', image(header(), chunk('IDAT', deflateSync(filtered().fill(5, 0, 1))))],
    ['no data', image(header())],
    ['a damaged checksum', flipped(image(header(), chunk('IDAT', data)), 60)],
    ['damaged data', image(header(), chunk('IDAT', flipped(data, 20)))],
    ['cut off', image(header(), chunk('IDAT', data)).slice(0, -12)],
    ['no PNG', new Uint8Array(100)],
])('%s is refused', async (_, bytes) => {
    await expect(read(bytes)).rejects.toBeInstanceOf(SceneError);
});

test('a large page needs bytes that can hold it', async () => {
    await expect(readPng(image(header(8192, 8192), chunk('IDAT', data)), 8192, 8192)).rejects.toThrow('found 201334784');
});
