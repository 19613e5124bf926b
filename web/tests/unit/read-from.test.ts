/** What is kept of a file when it has been read is enough to read it again. */

import { afterEach, expect, test, vi } from 'vitest';
import type { FromWorker, KeptFile, StoredSource } from '../../src/core/worker/messages';
import { readFrom } from '../../src/core/worker/read-from';
import { SceneSplats } from '../../src/core/read';
import { file, streamOf } from './scenes';

afterEach(() => vi.unstubAllGlobals());

async function read(source: StoredSource, maxSplats: number): Promise<{ splats: number[]; kept: KeptFile }> {
    const messages: FromWorker[] = [];
    await readFrom(source, maxSplats, (message) => messages.push(message));
    const last = messages.at(-1)!;
    if (last.kind !== 'done') throw new Error(JSON.stringify(last));
    const scene = new SceneSplats();
    for (const message of messages) if (message.kind === 'update') scene.apply(message.update);
    return { splats: [...scene.splats!.positions], kept: last.kept };
}

test.each([['all', Infinity], ['the first layer', 1]])('%s', async (_, maxSplats) => {
    const bytes = file('web/tests/data/layers.ltgs');
    let asked = 0;
    vi.stubGlobal('fetch', async () => {
        asked++;
        return new Response(streamOf(bytes, 100), { headers: { 'content-length': String(bytes.length) } });
    });
    const first = await read({ url: 'http://a.org/layers.ltgs' }, maxSplats);
    const again = await read(first.kept, maxSplats);
    expect(again.splats).toEqual(first.splats);
    expect(first.splats.length).toBeGreaterThan(0);
    expect(asked).toBe(1);
    // Of a file that is not wanted as a whole, its beginning is kept.
    if (maxSplats === Infinity) expect(first.kept.file.size).toBe(bytes.length);
    else expect(first.kept.file.size).toBeLessThan(bytes.length);
    expect(again.kept).toBe(first.kept);
});

test('a beginning without its length would not do', async () => {
    const bytes = file('web/tests/data/layers.ltgs');
    await expect(read({ file: new Blob([bytes.slice(0, bytes.length - 100)]) }, Infinity)).rejects.toThrow(/failed/);
});
