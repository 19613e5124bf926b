/** The core of the package in a browser that takes contexts away, and on networks that fail. */

import { readFileSync } from 'node:fs';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { BrowserTest, browserPath } from './browser';
import { setUpLoss } from './context';

const REPOSITORY = join(import.meta.dirname, '../../..');
const PATH = join(REPOSITORY, 'samples/conformance/balanced.ltgs');

describe.skipIf(!browserPath())('core', () => {
    let browser: BrowserTest;
    let server: Server;
    let other: string;
    let own: string;
    beforeAll(async () => {
        const bytes = readFileSync(PATH);
        server = createServer((request, response) => {
            const headers = { 'Content-Length': bytes.length };
            if (request.url === '/closed') response.writeHead(200, headers).end(bytes);
            else if (request.url === '/open') response.writeHead(200, { ...headers, 'Access-Control-Allow-Origin': '*' }).end(bytes);
            else if (request.url === '/cut') response.writeHead(200, { ...headers, 'Access-Control-Allow-Origin': '*' }).write(bytes.subarray(0, 3000), () => setTimeout(() => response.destroy(), 200));
            else response.writeHead(404, { 'Access-Control-Allow-Origin': '*' }).end();
        });
        await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
        other = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
        browser = await BrowserTest.open('tests/browser/element.html', [REPOSITORY], setUpLoss);
        own = new URL(browser.url).origin;
    });
    afterAll(async () => {
        await browser?.close();
        server?.close();
    });

    test('a renderer comes back after the loss of its context, with what is read again', async () => {
        const result = await browser.page.evaluate(async (url) => {
            const load = eval('(path) => import(path)'); // vitest would rewrite an import that it sees
            const { openScene, SplatRenderer, viewOf } = await load('/src/core/index.ts');
            const { lose, restore } = window as unknown as import('./context').LossWindow;
            const canvas = document.createElement('canvas');
            const happened: string[] = [];
            let again = Promise.resolve();
            const renderer = new SplatRenderer(canvas, { target: 'rgba32f', onLost: () => happened.push('lost'), onRestored: () => { happened.push('restored'); again = opened.again(); } });
            const opened = openScene({ url }, (info: object) => renderer.start(info), (update: object) => renderer.apply(update));
            await opened.done;
            const view = viewOf(renderer.info.cameras[0]);
            [canvas.width, canvas.height] = [view.widthPx, view.heightPx];
            const draw = async (): Promise<Float32Array> => {
                await renderer.sorted(view);
                renderer.draw(view);
                return renderer.read();
            };
            const before = await draw();
            const differences: number[] = [];
            for (let i = 0; i < 2; i++) {
                await lose(canvas);
                renderer.draw(view); // does nothing
                await renderer.sorted(view);
                await restore(canvas);
                await again;
                const after = await draw();
                differences.push(Math.max(...after.map((v, k) => Math.abs(v - before[k]))));
            }
            const { splats, bytes } = renderer.figures;
            // Given up by itself, twice at once, and taken again.
            renderer.release();
            renderer.retake();
            renderer.release();
            renderer.release();
            const figures = renderer.figures;
            renderer.retake();
            await new Promise<void>((resolve) => canvas.addEventListener('webglcontextrestored', () => resolve(), { once: true }));
            await again;
            differences.push(Math.max(...(await draw()).map((v, k) => Math.abs(v - before[k]))));
            const error = renderer.gl.getError();
            renderer.dispose();
            return { differences, happened, splats, bytes, released: [figures.splats, figures.bytes], error, range: Math.max(...before) };
        }, `/@fs/${PATH}`);
        expect(result).toMatchObject({ differences: [0, 0, 0], splats: 36, released: [36, 0], error: 0 });
        expect(result.happened).toEqual(['lost', 'restored', 'lost', 'restored', 'lost', 'restored']);
        expect(result.bytes).toBeGreaterThan(1000);
        expect(result.range).toBeGreaterThan(0.1);
    });

    /** What reading an address gives: the message of its error. */
    const failure = (url: string) => browser.page.evaluate(async (address) => {
        const load = eval('(path) => import(path)');
        const { openScene } = await load('/src/core/index.ts');
        return openScene({ url: address }, () => {}, () => {}).done.then(() => 'none', (error: Error) => error.message) as string;
    }, url);

    test('errors of the network name the address and the remedy', async () => {
        expect(await failure(`${other}/open`)).toBe('none');
        expect(await failure(`${other}/closed`)).toContain(`${other}/closed: the server does not answer, or does not allow pages of ${own} to read from it: it must send the header Access-Control-Allow-Origin: ${own}`);
        expect(await failure(`${other}/nothing`)).toBe(`${other}/nothing: the server answers 404 Not Found; is the address right?`);
        expect(await failure(`${other}/cut`)).toMatch(new RegExp(`^${other}/cut: the connection broke after 3000 bytes; load it again`));
        expect(await failure('http://127.0.0.1:9/scene.ltgs')).toMatch(/^http:\/\/127\.0\.0\.1:9\/scene\.ltgs: the server does not answer/);
        expect(await failure('file:///scene.ltgs')).toMatch(/^file:\/\/\/scene\.ltgs: browsers fetch nothing from the disk; serve the folder over http/);
        expect(await failure('http://[bad')).toBe('http://[bad: not a valid URL');
    });

    test('they do in three.js, where headers are sent', async () => {
        const message = await browser.page.evaluate(async (url) => {
            const load = eval('(path) => import(path)');
            const { LitetexLoader } = await load('/src/three/index.ts');
            const loader = new LitetexLoader();
            loader.setRequestHeader({ 'X-Key': 'a' });
            return loader.loadAsync(url).then(() => 'none', (error: Error) => error.message) as string;
        }, `${other}/closed`);
        expect(message).toContain(`${other}/closed: the server does not answer, or does not allow pages of ${own}`);
    });

    test('bytes stay those of the caller, and may be shared', async () => {
        const counts = await browser.page.evaluate(async (url) => {
            const load = eval('(path) => import(path)');
            const [{ openScene }, { readScene }] = await Promise.all([load('/src/core/index.ts'), load('/src/core/read/index.ts')]);
            const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
            const behind = new Uint8Array(bytes.length + 3);
            behind.set(bytes, 3);
            // Shared memory that needs no isolation of the page.
            const shared = new Uint8Array(new WebAssembly.Memory({ initial: 4, maximum: 4, shared: true }).buffer, 5, bytes.length);
            shared.set(bytes);
            let splats = 0;
            for (const source of [bytes.buffer, bytes, behind.subarray(3), shared]) await openScene({ bytes: source }, (info: { splats: number }) => { splats += info.splats; }, () => {}).done;
            for (const source of [bytes.buffer, bytes, behind.subarray(3), shared]) splats += (await readScene(source)).splats;
            return [splats, bytes.length, behind.length];
        }, `/@fs/${PATH}`);
        const { length } = readFileSync(PATH);
        expect(counts).toEqual([8 * 36, length, length + 3]);
    });
});
