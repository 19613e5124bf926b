import { readdirSync } from 'node:fs';
import { expect, test } from 'vitest';
import { file, join, messageOf, outcomeOf, randomOf, seal, split } from './scenes';

/** Files of the corpus that are read: the program reads them, too, but those of other versions of the extension. */
const READ = [
    'damaged_stand_in.ltgs',
    'layers.ltgs',
    'many_nodes.glb',
    'newer_extension.glb',
    'newer_minor_version.ltgs',
    'no_shifts.glb',
    'older_extension.glb',
    'overlapping_maps.glb',
    'same_page_many_times.glb',
    'stand_in.ltgs',
    'stand_in_of_a_stand_in.ltgs',
    'stand_in_that_is_none.ltgs',
    'thick_for_others.glb',
    'wrong_colours_for_others.glb',
];

const CORPUS = 'exporters/tests/corpus';
const names = readdirSync(new URL(`../../../${CORPUS}`, import.meta.url)).filter((name) => /\.(ltgs|glb|gltf)$/.test(name));

/** Time for a file; most take milliseconds. */
const MS_MAX = 2000;

/** Memory that a file may take, with what is left of others. */
const bytesMax = (fileBytes: number): number => 2 ** 28 + 64 * fileBytes;

async function measured(bytes: Uint8Array, options = {}): ReturnType<typeof outcomeOf> {
    const [start, before] = [performance.now(), process.memoryUsage()];
    const outcome = await outcomeOf(bytes, options);
    const after = process.memoryUsage();
    expect(performance.now() - start).toBeLessThan(MS_MAX);
    expect(after.arrayBuffers + after.heapUsed - before.arrayBuffers - before.heapUsed).toBeLessThan(bytesMax(bytes.length));
    return outcome;
}

test.each(names)('%s', async (name) => {
    const { error, splats } = await measured(file(`${CORPUS}/${name}`));
    if (READ.includes(name)) expect([error, splats!.count > 0]).toEqual([null, true]);
    else expect(messageOf(error)).toMatch(/^(invalid|unsupported): /);
});

test('files of other formats are told from damaged ones', async () => {
    for (const name of readdirSync(new URL(`../../../${CORPUS}`, import.meta.url))) {
        if (names.includes(name) || name.startsWith('empty')) continue;
        expect(messageOf((await outcomeOf(file(`${CORPUS}/${name}`))).error)).toMatch(/^unsupported: file: /);
    }
});

/** All places in a JSON value: the object or list, and the key in it. */
function placesIn(value: any): [any, string][] {
    if (typeof value !== 'object' || value === null) return [];
    return Object.keys(value).flatMap((key): [any, string][] => [[value, key], ...placesIn(value[key])]);
}

const ODD = [null, -1, 0.5, 1e300, 2 ** 32, 'text', '__proto__', [], {}, true, [[]], 7];

test('JSON with odd values is an error or a scene', async () => {
    const random = randomOf(Number(process.env.LITETEX_MUTATION_SEED ?? 1));
    const originals = [file('web/tests/data/tiny.glb'), file('samples/conformance/balanced.glb'), file(`${CORPUS}/no_shifts.glb`)];
    let read = 0;
    const rounds = process.env.LITETEX_MUTATION_SECS ? 20000 : 500;
    for (let i = 0; i < rounds; i += 1) {
        const { json, bin } = split(originals[random(originals.length)]);
        for (let changes = random(2); changes >= 0; changes -= 1) {
            const places = placesIn(json);
            const [parent, key] = places[random(places.length)];
            if (random(6) === 0) delete parent[key];
            else parent[key] = ODD[random(ODD.length)];
        }
        const { error } = await measured(join(json, bin));
        if (error === null) read += 1;
        else messageOf(error);
    }
    expect(read).toBeGreaterThan(0);
    expect(read).toBeLessThan(rounds / 2);
});

/** One to four changes; `others` lend bytes. */
function mutated(original: Uint8Array, others: readonly Uint8Array[], random: (bound: number) => number): Uint8Array {
    let bytes: Uint8Array = original.slice();
    // Half of them near the beginning, where headers and tables are.
    const place = (size: number): number => random(random(2) === 0 ? Math.min(size, 512) : size);
    const spliced = (at: number, removed: number, added: Uint8Array): Uint8Array =>
        Uint8Array.from([...bytes.subarray(0, at), ...added, ...bytes.subarray(at + removed)]);
    for (let changes = random(4); changes >= 0; changes -= 1) {
        const at = place(bytes.length);
        const run = 1 + random(64);
        const kind = random(7);
        if (kind < 2 && bytes.length > 0) bytes[at] ^= 1 << random(8);
        else if (kind === 2 && bytes.length > 0) bytes[at] = [0, 255, 127, random(256)][random(4)];
        else if (kind === 3 && at + 4 <= bytes.length) {
            const number = [0, 1, 4096, 65536, 2 ** 31, 2 ** 32 - 1, random(2 ** 32)][random(7)];
            new DataView(bytes.buffer).setUint32(at, number, true);
        } else if (kind === 4) bytes = spliced(at, run, new Uint8Array(0));
        else if (kind === 5) bytes = spliced(at, 0, new Uint8Array(run).map(() => random(256)));
        else if (kind === 6) {
            const other = others[random(others.length)];
            const from = place(other.length);
            const lent = other.subarray(from, from + 4 * run);
            bytes = spliced(at, lent.length, lent);
        }
        if (random(16) === 0) bytes = bytes.slice(0, at);
    }
    return bytes;
}

/** Where a `.ltgs` file begins in a file. */
function embedded(bytes: Uint8Array): number {
    for (let i = 0; i + 6 <= bytes.length; i += 1) {
        if (bytes[i] === 0x4c && bytes[i + 1] === 0x54 && bytes[i + 2] === 0x47 && bytes[i + 3] === 0x53 && bytes[i + 4] === 3) return i;
    }
    return -1;
}

test('mutated files are errors or scenes', { timeout: 1e9 }, async () => {
    const originals = [
        file('web/tests/data/lossless.ltgs'),
        file('web/tests/data/tiny.glb'),
        file('web/tests/data/layers.ltgs'),
        file('samples/conformance/balanced.ltgs'),
        file('samples/conformance/balanced.glb'),
        ...['newer_minor_version.ltgs', 'layers.ltgs', 'no_shifts.glb'].map((name) => file(`${CORPUS}/${name}`)),
    ];
    // A longer run: LITETEX_MUTATION_SECS=600 npx vitest run hostile
    const ms = 1000 * Number(process.env.LITETEX_MUTATION_SECS ?? 0);
    const random = randomOf(Number(process.env.LITETEX_MUTATION_SEED ?? 1));
    const start = performance.now();
    let [count, read, sealed, deep, slowest] = [0, 0, 0, 0, 0];
    for (; count < 2000 || performance.now() - start < ms; count += 1) {
        // Large ones are rarer.
        const original = originals[random(random(4) === 0 ? originals.length : 2)];
        const bytes = mutated(original, originals, random);
        const first = random(8) > 0 ? embedded(bytes) : -1;
        if (first >= 0) {
            const own = bytes.subarray(first);
            if (random(2) === 0 && own.length >= 64) new DataView(own.buffer, own.byteOffset).setUint32(40, own.length, true);
            seal(own);
            sealed += 1;
        }
        const before = performance.now();
        const { error } = await measured(bytes, random(4) === 0 ? { maxSplats: random(2000) } : {});
        slowest = Math.max(slowest, performance.now() - before);
        if (error === null) read += 1;
        else if (first >= 0 && !messageOf(error).includes('checksum')) deep += 1;
        else messageOf(error);
    }
    console.log(`${count} mutants: ${read} read, ${deep} of ${sealed} sealed ones found out past checksums; slowest ${slowest.toFixed(0)} ms`);
    // Negative controls: neither do mutations leave files whole, nor do checksums catch those of sealed files.
    expect(read).toBeGreaterThan(0);
    expect(read).toBeLessThan(count / 2);
    expect(deep).toBeGreaterThan(sealed / 2);
});
