/** Blocks that are decoded elsewhere give the same splats, updates and errors. */

import { afterEach, expect, test } from 'vitest';
import { type Helpers, type Job, type Part, decoded } from '../../src/core/read/ltgs/job';
import { readScene } from '../../src/core/read';
import { ENTRY_BYTES, HEADER_BYTES, readEntries, readHeader } from '../../src/core/read/ltgs/header';
import type { HelpedOptions } from '../../src/core/read/options';
import { help, Pool } from '../../src/core/worker/pool';
import { repeated } from './repeated';
import { file, messageOf, outcomeOf, type Outcome, randomOf, seal } from './scenes';
import { xxh3 } from '../../src/core/read/xxh3';
import type { Splats, SplatUpdate } from '../../src/core/scene';

const layers = file('web/tests/data/layers.ltgs');
const FILES = { layers, lossless: file('web/tests/data/lossless.ltgs'), 'stand-in': file('samples/conformance/stand-in.ltgs') };

const ports: MessagePort[] = [];
afterEach(() => ports.splice(0).forEach((port) => port.close()));

/** A pool whose helpers work in this thread. */
async function poolOf(count: number): Promise<Pool & { jobs: number }> {
    const pool = Object.assign(new Pool(() => {}), { jobs: 0 });
    for (let i = 0; i < count; i += 1) {
        const { port1, port2 } = new MessageChannel();
        ports.push(port1, port2);
        help(port1);
        pool.add(port2);
    }
    await new Promise((resolve) => setTimeout(resolve, 10)); // until they have answered
    const decode = pool.decode.bind(pool);
    pool.decode = (job) => {
        const part = decode(job);
        pool.jobs += part ? 1 : 0;
        return part;
    };
    return pool;
}

/** Decodes some blocks after times of its own, so that later ones are there before earlier ones; the others in place. */
function scattered(seed: number, isDone = () => {}): Helpers {
    const random = randomOf(seed);
    const later = (job: Job): Promise<Part> => new Promise((resolve, reject) => setTimeout(() => {
        isDone();
        try {
            resolve(decoded(job));
        } catch (error) {
            reject(error);
        }
    }, random(8)));
    return { call() {}, decode: (job) => (random(4) > 0 ? later(job) : null) };
}

/** Splats by the hashes of their arrays, which compare faster. */
const brief = (splats: Splats | null) => splats && Object.entries(splats).map(([name, value]) => [name, ArrayBuffer.isView(value) ? xxh3(new Uint8Array(value.buffer, value.byteOffset, value.byteLength)) : value]);
/** What became of a file; `updates`: with all that was given. */
const end = ({ error, splats, standIn }: Outcome) => ({ error, splats: brief(splats), standIn: brief(standIn) });
const whole = (outcome: Outcome) => ({ ...end(outcome), updates: outcome.updates.map((update) => ({ ...update, splats: brief(update.splats) })) });

test.each(Object.entries(FILES))('%s.ltgs: the same splats and updates', async (_, bytes) => {
    const alone = await outcomeOf(bytes);
    for (const count of [0, 1, 3]) {
        const pool = await poolOf(count);
        const options: HelpedOptions = { helpers: pool };
        expect(whole(await outcomeOf(bytes, options))).toEqual(whole(alone));
        expect(pool.jobs > 0).toBe(count > 0);
        expect(end(await outcomeOf(bytes, options, 300))).toEqual(end(alone));
    }
    for (let seed = 0; seed < 5; seed += 1) {
        const options: HelpedOptions = { helpers: scattered(seed) };
        expect(whole(await outcomeOf(bytes, options))).toEqual(whole(alone));
        const pieces = await outcomeOf(bytes, options, 300);
        expect(end(pieces)).toEqual(end(alone));
        const read = pieces.updates.map((update) => update.bytes);
        expect(read).toEqual([...read].sort((a, b) => a - b));
    }
});

test('what has arrived is shown while the rest is waited for', async () => {
    const updates: SplatUpdate[] = [];
    let at = 0;
    const slow = new ReadableStream<Uint8Array>({
        async pull(controller) {
            await new Promise((resolve) => setTimeout(resolve, 50));
            if (at >= layers.length) return controller.close();
            controller.enqueue(layers.slice(at, (at += 1000)));
        },
    }, { highWaterMark: 0 });
    const options: HelpedOptions = { helpers: scattered(1), onUpdate: (update) => updates.push(update) };
    await readScene(slow, options);
    expect(updates.length).toBeGreaterThan(3);
    expect(updates.map(({ complete }) => complete)).toContain(false);
    expect(updates.at(-1)!.complete).toBe(true);
});

test('many chunks', async () => {
    const bytes = await repeated(layers, 5);
    const alone = await outcomeOf(bytes);
    expect([alone.error, alone.splats!.count, alone.updates.length]).toEqual([null, 9000 + 4 * 4096, 3]);
    const pool = await poolOf(2);
    const options: HelpedOptions = { helpers: pool };
    expect(whole(await outcomeOf(bytes, options))).toEqual(whole(alone));
    expect(pool.jobs).toBeGreaterThan(5);
});

/** The blocks of `layers`. */
const BLOCKS = (() => {
    const header = readHeader(layers.subarray(0, HEADER_BYTES));
    const tables = HEADER_BYTES + header.metaBytes;
    return readEntries(layers.subarray(tables, tables + ENTRY_BYTES * header.chunks), header).flatMap(({ blocks }) => blocks);
})();

function damaged(...places: number[]): Uint8Array {
    const copy = layers.slice();
    for (const place of places) copy[place] ^= 0x55;
    return copy;
}

test('the first error in the order of the file is told, and what stands before it is shown', async () => {
    const found = new Set<string>();
    for (const [i, { offset, bytes }] of BLOCKS.entries()) {
        // Found out as a block is decoded, alone and with another; by a checksum; by decoding, and a checksum behind.
        const [decoding, both] = [damaged(offset), damaged(offset, BLOCKS[(i + 3) % BLOCKS.length].offset)];
        [decoding, both].forEach(seal);
        const behind = decoding.slice();
        behind[behind.length - 1] ^= 1;
        for (const [k, changed] of [decoding, both, damaged(offset + (bytes >> 1)), behind].entries()) {
            const alone = await outcomeOf(changed);
            found.add(messageOf(alone.error));
            for (const helpers of [scattered(i + k), await poolOf(2)]) {
                const options: HelpedOptions = { helpers };
                expect(whole(await outcomeOf(changed, options))).toEqual(whole(alone));
            }
        }
    }
    expect(found.size).toBeGreaterThan(8);
});

test('an error does not wait for a file that stops arriving', async () => {
    const [{ offset, bytes }] = BLOCKS;
    const changed = damaged(offset);
    seal(changed);
    const stalled = new ReadableStream<Uint8Array>({ start: (controller) => controller.enqueue(changed.slice(0, offset + bytes)) });
    const options: HelpedOptions = { helpers: { call() {}, decode: async (job) => decoded(job) } };
    const { error } = await outcomeOf(changed);
    await expect(readScene(stalled, options)).rejects.toEqual(error);
});

test('nothing is shown after an abort', async () => {
    for (let jobs = 1; jobs < 12; jobs += 1) {
        const aborter = new AbortController();
        let [done, late] = [0, 0];
        const helpers = scattered(jobs, () => {
            done += 1;
            if (done === jobs) aborter.abort(new Error('enough'));
        });
        const options: HelpedOptions = { helpers, signal: aborter.signal, onUpdate: () => { late += aborter.signal.aborted ? 1 : 0; } };
        const outcome = await readScene(layers, options).then(() => 'read', (error: Error) => error.message);
        expect([outcome, late]).toEqual([done >= jobs ? 'enough' : 'read', 0]);
        if (jobs < 5) expect(outcome).toBe('enough');
    }
});

test('a helper that never answers is not relied on', async () => {
    const pool = new Pool(() => {});
    const { port1, port2 } = new MessageChannel();
    ports.push(port1, port2);
    pool.add(port2);
    const options: HelpedOptions = { helpers: pool };
    expect(whole(await outcomeOf(layers, options))).toEqual(whole(await outcomeOf(layers)));
});
