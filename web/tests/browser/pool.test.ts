/** Files of many chunks are read by several workers. */

import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { repeated } from '../unit/repeated';
import { BrowserTest, browserPath } from './browser';

const LAYERS = join(import.meta.dirname, '../data/layers.ltgs');

/** What becomes of workers behind the first: they start; their constructor throws, as browsers may; their script fails, or says nothing. */
type Others = 'start' | 'throw' | 'fail' | 'say nothing';

describe.skipIf(!browserPath())('several workers', () => {
    let browser: BrowserTest;
    const folder = mkdtempSync(join(tmpdir(), 'litetex-pool-'));
    const many = `/@fs/${join(folder, 'many.ltgs')}`;
    beforeAll(async () => {
        const layers = new Uint8Array(readFileSync(LAYERS));
        writeFileSync(join(folder, 'many.ltgs'), await repeated(layers, 22));
        const damaged = await repeated(layers, 22);
        damaged[damaged.length - 100] ^= 1;
        writeFileSync(join(folder, 'damaged.ltgs'), damaged);
        if (process.env.LITETEX_FIGURES) writeFileSync(join(folder, 'figure.ltgs'), await repeated(layers, 47));
        browser = await BrowserTest.open('tests/browser/element.html', [folder]);
    });
    afterAll(async () => {
        await browser?.close();
        rmSync(folder, { recursive: true });
    });

    /** Reads a file on a device of this number of cores; closes it at the first update, if wanted. */
    const read = (url: string, cores: number, others: Others = 'start', isClosed = false) => browser.page.evaluate(async ([address, count, rest, closes]) => {
        const load = eval('(path) => import(path)'); // vitest would rewrite an import that it sees
        const [{ openScene }, { SceneSplats }, { contentHash }] = await Promise.all(['index', 'read/index', 'read/hash'].map((name) => load(`/src/core/${name}.ts`)));
        Object.defineProperty(navigator, 'hardwareConcurrency', { value: count, configurable: true });
        const Own = Worker;
        let [started, ended] = [0, 0];
        window.Worker = class extends Own {
            constructor(script: string | URL, options?: WorkerOptions) {
                const isOther = started > 0;
                if (isOther && rest === 'throw') throw new Error('no more workers');
                const text = rest === 'fail' ? 'throw new Error("broken")' : '';
                super(isOther && rest !== 'start' ? URL.createObjectURL(new Blob([text])) : script, options);
                started++;
            }
            override terminate(): void {
                ended++;
                super.terminate();
            }
        };
        try {
            const scene = new SceneSplats();
            const updates: unknown[] = [];
            let info: unknown = null;
            let toClose = () => {};
            const closed = new Promise<string>((resolve) => { toClose = () => resolve('closed'); });
            const start = performance.now();
            const opened = openScene({ url: new URL(address, location.href).href }, (own: unknown) => { info = own; }, (update: { first: number; bytes: number; complete: boolean; splats: { count: number } }) => {
                scene.apply(update);
                updates.push(update.first + update.splats.count);
                if (closes) toClose();
            });
            const outcome = await Promise.race([opened.done.then(() => 'done', (error: Error) => error.message), closed]);
            const ms = performance.now() - start;
            if (closes) opened.close();
            return { outcome, updates: updates.at(-1), started, ended, ms, hash: closes || !info ? '' : contentHash([scene.splats], info) };
        } finally {
            window.Worker = Own;
        }
    }, [url, cores, others, isClosed] as const);

    test('read the same as one, and end', async () => {
        const alone = await read(many, 1);
        expect(alone).toMatchObject({ outcome: 'done', updates: 9000 + 21 * 4096, started: 1, ended: 1 });
        const { ms: _, ...same } = alone;
        expect(await read(many, 2)).toMatchObject({ ...same, started: 2, ended: 2 });
        // Where no others can be had, the first one goes on.
        expect(await read(many, 2, 'throw')).toMatchObject({ ...same, started: 1, ended: 1 });
        expect(await read(many, 2, 'fail')).toMatchObject({ ...same, started: 2, ended: 2 });
        expect(await read(many, 2, 'say nothing')).toMatchObject({ ...same, started: 2, ended: 2 });
        // Negative controls: small files, and other splats.
        const small = await read(`/@fs/${LAYERS}`, 8);
        expect(small).toMatchObject({ outcome: 'done', started: 1, ended: 1 });
        expect(small.hash).not.toBe(alone.hash);
    });

    test('end when reading fails, and when it is stopped', async () => {
        const damaged = `/@fs/${join(folder, 'damaged.ltgs')}`;
        const alone = await read(damaged, 1);
        expect(alone.outcome).toContain('checksum of a block');
        expect(await read(damaged, 2)).toMatchObject({ outcome: alone.outcome, hash: alone.hash, started: 2, ended: 2 });
        expect(await read(many, 2, 'start', true)).toMatchObject({ outcome: 'closed', started: 2, ended: 2 });
    });

    test.runIf(process.env.LITETEX_FIGURES)('what they gain', async () => {
        const figure = `/@fs/${join(folder, 'figure.ltgs')}`;
        const ms: Record<number, number[]> = { 1: [], 2: [] };
        for (let round = 0; round < 3; round++) for (const cores of [1, 2]) ms[cores].push((await read(figure, cores)).ms);
        const best = Object.entries(ms).map(([cores, all]) => `${cores}: ${Math.round(Math.min(...all))}`);
        console.log(`197,416 splats, 5,000 texels, milliseconds by workers, best of three: ${best.join(', ')}`);
    });
});
