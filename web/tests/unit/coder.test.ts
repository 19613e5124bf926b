import { expect, test } from 'vitest';
import { D, Numbers, S } from '../../src/core/read/ltgs/numbers';
import { xxh3 } from '../../src/core/read/xxh3';
import { file } from './scenes';

interface Vector {
    readonly name: string;
    readonly bytes: string;
    readonly bytesXxh3: string;
    readonly contexts: readonly (readonly number[] | string)[];
    readonly count: number;
    readonly numbers?: readonly number[];
    readonly numbersXxh3: string;
}

const pack = JSON.parse(new TextDecoder().decode(file('samples/conformance/coder.json')));
const vectors: readonly Vector[] = pack.streams;

const bytesOf = (hex: string): Uint8Array => Uint8Array.from(hex.match(/../g) ?? [], (digits) => parseInt(digits, 16));
const hashOf = (array: ArrayBufferView): string => xxh3(new Uint8Array(array.buffer, array.byteOffset, array.byteLength));

function decoded({ contexts, count }: Vector, bytes: Uint8Array): Uint32Array {
    const reader = new Numbers();
    if (count === 0) return new Uint32Array(0);
    const valuesOf = (i: number): number => (contexts[i] === undefined ? 0 : typeof contexts[i] === 'string' ? 7 : Math.max(...contexts[i]) + 1);
    const value = (i: number, k: number): number => {
        const own = contexts[i];
        return own === undefined ? 0 : typeof own === 'string' ? k % [7, 3][i] : own[k];
    };
    reader.start(bytes, valuesOf(0), valuesOf(1));
    const numbers = new Uint32Array(count).map((_, k) => reader.next(value(0, k), value(1, k)));
    reader.end();
    return numbers;
}

test.each(vectors.map((vector) => [`${vector.name}, ${1 + vector.contexts.length} contexts`, vector] as const))('%s', (_, vector) => {
    const bytes = bytesOf(vector.bytes);
    expect(hashOf(bytes)).toBe(vector.bytesXxh3);
    const numbers = decoded(vector, bytes);
    expect(hashOf(numbers)).toBe(vector.numbersXxh3);
    if (vector.numbers) expect([...numbers]).toEqual(vector.numbers);
    if (bytes.length === 0) return;
    // Negative controls: a changed byte, a byte less, bytes too many.
    const changed = bytes.slice();
    changed[0] ^= 0x10;
    for (const damaged of [changed, bytes.slice(0, -1), Uint8Array.from([...bytes, 1, 1, 1, 1, 1]), Uint8Array.from([...bytes, 0])]) {
        let found = '';
        try {
            found = hashOf(decoded(vector, damaged));
        } catch (error) {
            expect(String(error)).toContain('SceneError');
        }
        expect(found).not.toBe(vector.numbersXxh3);
    }
});

test('generated numbers follow their rule', () => {
    const { count, numbersXxh3 } = vectors.find(({ name }) => name === 'generated')!;
    let state = 1n;
    const numbers = new Uint32Array(count).map((_, i) => {
        state = (state * 6364136223846793005n + 1442695040888963407n) & 0xffffffffffffffffn;
        const r = Number((state >> 40n) & 0xffffn);
        if (i >= 2000) return i === count - 1 ? 1 : 0;
        return i % 100 === 99 ? Math.floor((2 ** 32 - 1 - i) / 2 ** Math.floor(i / 100)) : Math.floor(r / 2 ** (2 * (i % 7) + 2)) + 5 * (i % 3);
    });
    expect(hashOf(numbers)).toBe(numbersXxh3);
});

test('tables are those of the specification', () => {
    expect({ S: hashOf(Uint16Array.from(S)), D: hashOf(Int16Array.from(D)) }).toEqual(pack.tables);
});
