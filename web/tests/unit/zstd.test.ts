import { expect, test } from 'vitest';
import { xxh3 } from '../../src/core/read/xxh3';
import { unpacked } from '../../src/core/read/zstd';
import { SceneError } from '../../src/core/scene';
import { file, randomOf } from './scenes';

interface Vector {
    readonly name: string;
    readonly bytes: number;
    readonly xxh3: string;
    readonly frame: string;
}

/** Frames of the reference library, and the hashes of what they hold. */
const vectors: readonly Vector[] = JSON.parse(new TextDecoder().decode(file('web/tests/data/zstd.json')));
const frameOf = ({ frame }: Vector): Uint8Array => Uint8Array.from(atob(frame), (c) => c.charCodeAt(0));

test.each(vectors.map((vector) => [vector.name, vector] as const))('%s', (_, vector) => {
    const frame = frameOf(vector);
    expect(xxh3(unpacked(frame, vector.bytes))).toBe(vector.xxh3);
    // Of other sizes than stated, cut off, followed by more.
    for (const count of [vector.bytes - 1, vector.bytes + 1]) expect(() => unpacked(frame, count)).toThrow(SceneError);
    expect(() => unpacked(frame.subarray(0, -1), vector.bytes)).toThrow(SceneError);
    expect(() => unpacked(Uint8Array.from([...frame, 0]), vector.bytes)).toThrow(SceneError);
});

test('a few bytes cannot claim many', () => {
    expect(() => unpacked(new Uint8Array(16), 2 ** 31)).toThrow('zstd');
});

test('damaged frames are errors, in bounded time', () => {
    const random = randomOf(1);
    let same = 0;
    for (let i = 0; i < 3000; i += 1) {
        const vector = vectors[random(vectors.length)];
        const frame = frameOf(vector);
        for (let k = random(3); k >= 0; k -= 1) frame[random(frame.length)] ^= 1 << random(8);
        const start = performance.now();
        try {
            same += xxh3(unpacked(frame, vector.bytes)) === vector.xxh3 ? 1 : 0;
        } catch (error) {
            expect(error).toBeInstanceOf(SceneError);
        }
        expect(performance.now() - start).toBeLessThan(1000);
    }
    expect(same).toBeLessThan(500);
});
