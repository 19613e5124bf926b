import { describe, expect, test } from 'vitest';
import { readScene } from '../../src/core/read';
import { contentHash } from '../../src/core/read/hash';
import { readEntries, readHeader } from '../../src/core/read/ltgs/header';
import type { Splats } from '../../src/core/scene';
import { file, messageOf, outcomeOf, seal } from './scenes';

const corpus = (name: string) => file(`exporters/tests/corpus/${name}`);
const FILES = {
    balanced: file('samples/conformance/balanced.ltgs'),
    lossless: file('web/tests/data/lossless.ltgs'),
    layers: file('web/tests/data/layers.ltgs'),
    equal: file('exporters/tests/corpus/layers.ltgs'),
    'stand-in': file('samples/conformance/stand-in.ltgs'),
};

function blocksOf(bytes: Uint8Array): { chunk: number; kind: number; offset: number; end: number }[] {
    const header = readHeader(bytes.subarray(0, 64));
    const first = 64 + header.metaBytes;
    return readEntries(bytes.subarray(first, first + 112 * header.chunks), header).flatMap(({ blocks }, chunk) =>
        blocks.map(({ offset, bytes: size }, kind) => ({ chunk, kind, offset, end: offset + size })),
    );
}

const sums = ({ shDegrees, rows, cols }: Splats) => ({
    sh: shDegrees.reduce((sum, degree) => sum + 3 * (degree + 1) ** 2, 0),
    texels: rows.reduce((sum, count, i) => sum + 3 * count * cols[i], 0),
});

describe.each(Object.entries(FILES))('%s.ltgs', (_, bytes) => {
    test('its content has the hash that it states', async () => {
        const { info, splats, updates, error } = await outcomeOf(bytes);
        expect(error).toBeNull();
        expect([splats!.count, splats!.texels.length / 3]).toEqual([info!.splats, info!.texels]);
        expect([splats!.sh.length, splats!.texels.length]).toEqual(Object.values(sums(splats!)));
        expect(updates.every(({ complete }) => complete)).toBe(true);
        expect(updates.at(-1)!.bytes).toBe(bytes.length);
        expect(info!.fileBytes).toBe(bytes.length);
    });

    test('it is the same in pieces of any size, and gets better with each update', async () => {
        const whole = await outcomeOf(bytes);
        for (const pieceBytes of [100, 1000]) {
            const { splats, updates, error } = await outcomeOf(bytes, {}, pieceBytes);
            expect(error).toBeNull();
            expect(splats).toEqual(whole.splats);
            let [count, before] = [0, 0];
            for (const update of updates) {
                expect(update.first).toBeLessThanOrEqual(count);
                expect(update.first + update.splats.count).toBeGreaterThanOrEqual(count);
                expect(update.bytes).toBeGreaterThanOrEqual(before);
                [count, before] = [update.first + update.splats.count, update.bytes];
            }
            expect(updates.at(-1)!.complete).toBe(true);
            expect(updates.length).toBeGreaterThanOrEqual(whole.updates.length);
        }
    });

    test('every beginning of it can be shown, and the error comes at the end', async () => {
        const blocks = blocksOf(bytes);
        const cuts = new Set([0, 1, 63, 64, 65, 500, bytes.length - 1]);
        for (const { offset, end } of blocks) for (const cut of [offset, (offset + end) >> 1, end - 1]) cuts.add(cut);
        cuts.delete(bytes.length);
        let pieceBytes: number | undefined;
        for (const cut of cuts) {
            pieceBytes = pieceBytes === undefined ? 100 : undefined;
            const { splats, error } = await outcomeOf(bytes.slice(0, cut), {}, pieceBytes);
            expect(messageOf(error)).toMatch(cut < 4 ? /^unsupported/ : /^invalid: truncated/);
            const chunks = blocks.filter(({ kind, end }) => kind === 0 && end <= cut).length;
            expect((splats?.count ?? 0) > 0).toBe(chunks > 0);
            if (splats) expect([splats.sh.length, splats.texels.length]).toEqual(Object.values(sums(splats)));
        }
    });

    test('the first splats are enough', async () => {
        const whole = (await outcomeOf(bytes)).splats!;
        for (const maxSplats of [0, 2, 1126, 5000, 1e9]) {
            const { info, splats, error } = await outcomeOf(bytes, { maxSplats }, 512);
            expect(error).toBeNull();
            const count = Math.min(maxSplats, whole.count);
            expect([info!.splats, splats?.count ?? 0]).toEqual([whole.count, count]);
            if (count > 0) expect(splats!.positions).toEqual(whole.positions.slice(0, 3 * count));
            if (count > 0) expect([splats!.sh.length, splats!.texels.length]).toEqual(Object.values(sums(splats!)));
        }
    });

    test('negative control: any other number has another hash', async () => {
        const { info, splats } = await outcomeOf(bytes);
        const hash = contentHash([splats!], info!);
        for (const name of ['positions', 'rotations', 'scales', 'opacities', 'sh', 'rows', 'cols', 'texelSizes', 'shifts', 'texels'] as const) {
            const array = splats![name].slice();
            if (array.length === 0) continue;
            array[array.length - 1] = -array[array.length - 1] || 1;
            expect(contentHash([{ ...splats!, [name]: array }], info!)).not.toBe(hash);
        }
        expect(contentHash([splats!], { ...info!, near: info!.near + 1 })).not.toBe(hash);
        expect(contentHash([splats!], info!)).toBe(hash);
    });

    test('negative control: a changed byte is noticed', async () => {
        for (let at = 5; at < bytes.length; at += Math.ceil(bytes.length / 30)) {
            const changed = bytes.slice();
            changed[at] ^= 4;
            const { error, warnings } = await outcomeOf(changed);
            expect(error ? messageOf(error) : warnings.join()).toMatch(/checksum|version|magic/);
        }
    });
});

describe('a stand-in', () => {
    const { balanced, 'stand-in': bytes } = FILES;

    test('comes before the splats of the scene, which are the same without it', async () => {
        const order: string[] = [];
        const info = await readScene(bytes, { onStandIn: ({ count }) => order.push(`${count} splats`), onUpdate: () => order.push('update') });
        expect(order).toEqual(['12 splats', 'update']);
        const [found, plain] = [await outcomeOf(bytes), await outcomeOf(balanced)];
        expect(found.splats).toEqual(plain.splats);
        expect([plain.standIn, plain.info!.standInUntil]).toEqual([null, null]);
        expect([found.standIn!.count, found.standIn!.texels.length, found.standIn!.sh.length]).toEqual([12, 0, 36]);
        expect(info.standInUntil).toBe(blocksOf(bytes)[0].offset + 5000);
    });

    test('is skipped where nobody wants it, and of a beginning that holds no more it is there', async () => {
        await readScene(bytes, {});
        const { offset } = blocksOf(bytes)[0];
        const { standIn, splats, error } = await outcomeOf(bytes.slice(0, offset));
        expect([standIn?.count, splats, messageOf(error)]).toEqual([12, null, expect.stringMatching(/^invalid: truncated/)]);
        const cut = await outcomeOf(bytes.slice(0, offset - 1));
        expect([cut.standIn, messageOf(cut.error)]).toEqual([null, expect.stringMatching(/^invalid: truncated/)]);
    });

    test('is left out where it is damaged, and the scene is there', async () => {
        const damaged = bytes.slice();
        damaged[blocksOf(bytes)[0].offset - 1] ^= 1;
        for (const [given, why] of [
            [damaged, /checksum of the stand-in/], [corpus('stand_in_of_a_stand_in.ltgs'), /stand-in of the stand-in/],
            [corpus('stand_in_that_is_none.ltgs'), /truncated|magic|version/],
        ] as const) {
            const { standIn, splats, warnings, error } = await outcomeOf(given);
            expect([standIn, splats === null, error]).toEqual([null, false, null]);
            expect(warnings.join()).toMatch(why);
        }
    });
});

test('metadata of the conformance scene', async () => {
    const { info } = await outcomeOf(FILES.balanced);
    expect(info).toMatchObject({
        container: 'ltgs',
        quality: 'balanced',
        splats: 36,
        texels: 5628,
        shDegree: 3,
        near: 0.25,
        filter: 'ewa',
        background: [0.125, Math.fround(0.4), Math.fround(0.7)],
        colourSpace: 'srgb_rec709_display',
        untextured: null,
        provenance: { title: 'Conformance scene', author: '', training: {} },
    });
    expect(info!.cameras.map(({ name, widthPx, heightPx }) => [name, widthPx, heightPx])).toEqual([['wide', 100, 75], ['side', 84, 92], ['inside', 104, 68]]);
    expect(info!.cameras[0].rotation).toEqual([1, 0, 0, 0, -1, 0, 0, 0, -1]);
    expect(info!.cameras[0]).toMatchObject({ focalPx: [75.25, 89.125], principalPx: [41.875, 45.75], heldOut: false });
    // The node of the same scene as glTF: scale 2.5, rotation xyzw (-0.5, -0.1, -0.7, 0.5), translation (10, 3, -0.5).
    const expected = [0, -1.5, 2, 0, 2, -1.2, -0.9, 0, 1.5, 1.6, 1.2, 0, 10, 3, -0.5, 1];
    info!.worldFromData.forEach((value, i) => expect(value).toBeCloseTo(expected[i], 12));
});

test('splats without their texels show the means of their maps', async () => {
    const { balanced } = FILES;
    const { end } = blocksOf(balanced)[0];
    const { splats: untextured, updates } = await outcomeOf(balanced.slice(0, end + 10));
    const { splats } = await outcomeOf(balanced);
    expect(updates.map(({ complete }) => complete)).toEqual([false]);
    expect([...untextured!.shDegrees, ...untextured!.rows].every((v) => v === 0)).toBe(true);
    const first = splats!.shDegrees.reduce<number[]>((ends, degree) => [...ends, ends.at(-1)! + 3 * (degree + 1) ** 2], [0]);
    const changed = Array.from(splats!.rows.keys()).filter((i) => splats!.sh[first[i]] !== untextured!.sh[3 * i]);
    expect(changed.every((i) => splats!.rows[i] > 0)).toBe(true);
    expect(changed.length).toBeGreaterThan(20);
});

test('what is behind the wanted splats is not waited for', async () => {
    let pulled = 0;
    let cancelled = false;
    const stream = new ReadableStream<Uint8Array>(
        {
            pull(controller) {
                controller.enqueue(FILES.layers.slice(pulled, pulled + 256));
                pulled += 256;
            },
            cancel() {
                cancelled = true;
            },
        },
        { highWaterMark: 0 },
    );
    await readScene(stream, { maxSplats: 1000 });
    expect(pulled).toBeLessThan(3200);
    expect(cancelled).toBe(true);
});

test('reading is aborted, also while nothing arrives', async () => {
    const controller = new AbortController();
    const stalled = new ReadableStream<Uint8Array>({ start: (c) => c.enqueue(FILES.balanced.slice(0, 5000)) });
    const reading = readScene(stalled, { signal: controller.signal });
    setTimeout(() => controller.abort(new Error('enough')), 20);
    await expect(reading).rejects.toThrow('enough');
    await expect(readScene(FILES.balanced, { signal: AbortSignal.abort(new Error('before')) })).rejects.toThrow('before');
});

test('errors of a stream are passed on', async () => {
    const failing = new ReadableStream<Uint8Array>({ pull: (c) => c.error(new TypeError('network')) });
    await expect(readScene(failing)).rejects.toThrow('network');
});

test('wrong numbers behind right checksums are found', async () => {
    const changed = async (bytes: Uint8Array, change: (view: DataView, meta: number) => void): Promise<string> => {
        const out = bytes.slice();
        const view = new DataView(out.buffer);
        change(view, 64 + view.getUint32(28, true));
        seal(out);
        return messageOf((await outcomeOf(out)).error);
    };
    const { layers } = FILES;
    expect(await changed(layers, (view) => view.setUint32(12, 9001, true))).toContain('splats of the chunks');
    expect(await changed(layers, (view) => view.setUint32(16, 7, true))).toContain('texels of the chunks');
    expect(await changed(layers, (view) => view.setUint8(24, 3))).toContain('invalid');
    expect(await changed(layers, (view) => view.setUint8(25, 0))).toContain('layer of chunk 1');
    expect(await changed(layers, (view, table) => view.setUint32(table + 84, 1, true))).toContain('layer of chunk 0');
    expect(await changed(layers, (view, table) => view.setUint32(table + 80, 1124, true))).toContain('splats of the chunks');
    expect(await changed(layers, (view, table) => view.setUint32(table + 24, 0, true))).toContain('place of a block');
    expect(await changed(layers, (view) => view.setUint32(40, layers.length - 100, true))).toContain('place of a block');
    expect(await changed(layers, (view) => view.setUint32(36, 0xffffffff, true))).toContain('chunks of the header');
});

test('longer files than stated are refused', async () => {
    const longer = new Uint8Array(FILES.lossless.length + 1);
    longer.set(FILES.lossless);
    expect(messageOf((await outcomeOf(longer)).error)).toContain('bytes of the file');
});

test.each([
    ['ply\nformat', 'PLY'],
    ['NGSP\x04', 'SPZ'],
    ['\x1f\x8b\x08', 'SPZ'],
    ['#usda 1.0', 'OpenUSD'],
    ['PXR-USDC', 'OpenUSD'],
    ['PK\x03\x04', 'zip'],
    ['<!doctype html>', 'HTML'],
    ['\n <html>', 'HTML'],
    ['{"asset": {}}', '.gltf'],
    ['\xef\xbb\xbf {', '.gltf'],
    ['\x89PNG\r\n', 'found an image,'],
    ['<script>'.repeat(50), 'HTML'],
    ['GARBAGE!', 'found "GARBAGE!",'],
    ['', '""'],
])('%j is said to be of another format', async (start, word) => {
    for (const pieceBytes of [undefined, 1]) {
        const { error } = await outcomeOf(Uint8Array.from(start, (c) => c.charCodeAt(0)), {}, pieceBytes);
        expect(messageOf(error)).toMatch(/^unsupported: file: found .*, expected \.ltgs or \.glb$/);
        expect(messageOf(error)).toContain(word);
    }
});
