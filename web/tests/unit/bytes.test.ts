/** Bytes of every kind that programs hold are read alike, and left as they are. */

import { Readable } from 'node:stream';
import { runInNewContext } from 'node:vm';
import { expect, test } from 'vitest';
import { readScene, SceneSplats } from '../../src/core/read';
import { contentHash } from '../../src/core/read/hash';
import { file } from './scenes';

const FILES = ['samples/conformance/balanced.ltgs', 'web/tests/data/lossless.ltgs', 'samples/conformance/balanced.glb', 'samples/conformance/lossless.glb'];

async function hashOf(from: Parameters<typeof readScene>[0]): Promise<string> {
    const scene = new SceneSplats();
    const info = await readScene(from, { onUpdate: (update) => scene.apply(update) });
    return contentHash([scene.splats!], info);
}

/** The same bytes behind others, at a place that no number of more than a byte is aligned to. */
function behind<T extends Uint8Array>(bytes: Uint8Array, make: (length: number) => T): T {
    const all = make(bytes.length + 14);
    all.fill(0xa5);
    all.set(bytes, 7);
    return all.subarray(7, 7 + bytes.length) as T;
}

const KINDS: Record<string, (bytes: Uint8Array) => Parameters<typeof readScene>[0]> = {
    'a Buffer': (bytes) => Buffer.from(bytes),
    'a part of a Buffer': (bytes) => behind(bytes, (length) => Buffer.allocUnsafeSlow(length)),
    'a part of an array': (bytes) => behind(bytes, (length) => new Uint8Array(length)),
    'shared memory': (bytes) => behind(bytes, (length) => new Uint8Array(new SharedArrayBuffer(length))) as Uint8Array<never>,
    'an array of another realm': (bytes) => runInNewContext('Uint8Array.from(bytes)', { bytes }) as Uint8Array,
    'a buffer of another realm': (bytes) => runInNewContext('Uint8Array.from(bytes).buffer', { bytes }) as ArrayBuffer,
    'a stream of Buffers': (bytes) => Readable.toWeb(Readable.from([...pieces(Buffer.from(bytes), 1000)])) as ReadableStream<Uint8Array>,
    'a stream of parts of the pool': (bytes) => Readable.toWeb(Readable.from([...pieces(bytes, 500)].map((piece) => Buffer.from(piece)))) as ReadableStream<Uint8Array>,
};

function* pieces<T extends Uint8Array>(bytes: T, length: number): Generator<T> {
    for (let at = 0; at < bytes.length; at += length) yield bytes.subarray(at, at + length) as T;
}

test.each(Object.entries(KINDS))('%s', async (_, make) => {
    for (const path of FILES) {
        const from = make(file(path));
        const hash = await hashOf(from);
        expect(hash).toBe(await hashOf(file(path)));
        // Read once more: the first time has changed nothing.
        if (!('getReader' in from)) expect(await hashOf(from)).toBe(hash);
    }
});
