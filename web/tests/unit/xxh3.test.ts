import { expect, test } from 'vitest';
import { Xxh3, xxh3 } from '../../src/core/read/xxh3';

/** Hashes of the first bytes (131 i + 17 floor(i / 256) + 7) mod 256, by the library of the author of xxHash. */
const HASHES: readonly (readonly [number, string])[] = [
    [0, '2d06800538d394c2'],
    [1, '4c5cca45d0f4811f'],
    [2, '29c60963cbfa4e6e'],
    [3, '6e3e2670e61106ac'],
    [4, '5c4c63133443d03f'],
    [5, '49f5eb3111280b63'],
    [8, 'f9fd4dd0b04d78f5'],
    [9, '7c20df9712c26edf'],
    [15, 'b345a7b2698ba575'],
    [16, '86abf6baccea0858'],
    [17, 'b58bf5dc5022d071'],
    [32, 'e3712ed84c04a66e'],
    [33, 'a4dee99b093e1f73'],
    [64, '1291d2d4042330dd'],
    [65, '97c6bf83217e5ec9'],
    [96, '81296929fc063365'],
    [97, 'f145a45b658ab9dd'],
    [128, '10d17f72c0ccba41'],
    [129, '1648bdc3db49d1a2'],
    [143, 'd05ced598f7f87b3'],
    [144, 'b46dbfc6d9e31aba'],
    [200, 'c0fbc0f4e181c826'],
    [240, 'b6cfaf343fab81e6'],
    [241, '956cae592c67279e'],
    [255, '64a6073025eb7929'],
    [256, 'b15e550733c5dfac'],
    [257, 'c6dea86d5afd33ae'],
    [511, '1196c0e51d3ad3fa'],
    [512, '31cc4c8456761b50'],
    [1023, 'aa76836516a7ea30'],
    [1024, 'a1e16f2edf2cbed6'],
    [1025, '0a6d2c17259fe4bb'],
    [1087, 'c1f1fb3c5704335c'],
    [1088, '0ef0c0dc0e8682f1'],
    [1089, 'e9459411d2759a81'],
    [2048, '1c81a12455515459'],
    [2049, 'e54b75096179fb9c'],
    [5000, 'aedbe953d207917d'],
    [65537, '16210440cfed656e'],
];

const bytes = (count: number): Uint8Array => Uint8Array.from({ length: count }, (_, i) => 131 * i + 17 * (i >> 8) + 7);

test.each(HASHES)('%i bytes, at once and in parts', (count, hash) => {
    const all = bytes(count);
    expect(xxh3(all)).toBe(hash);
    for (const part of [1, 63, 64, 1000]) {
        const hasher = new Xxh3();
        for (let at = 0; at < count; at += part) hasher.update(all.subarray(at, at + part));
        expect(hasher.hex()).toBe(hash);
    }
});

test('every bit counts', () => {
    for (const count of [3, 8, 16, 100, 200, 1500]) {
        const all = bytes(count);
        const hash = xxh3(all);
        all[count >> 1] ^= 1;
        expect(xxh3(all)).not.toBe(hash);
    }
});
