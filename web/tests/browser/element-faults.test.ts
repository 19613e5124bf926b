/** What goes wrong around `<litetex-viewer>`: networks, elements without an area, what is held while it leaves the document. */

import { readFileSync } from 'node:fs';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { join } from 'node:path';
import { afterAll, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import type { LitetexViewerElement } from '../../src/element';
import { BrowserTest, browserPath } from './browser';
import { type LossWindow, setUpLoss } from './context';

const REPOSITORY = join(import.meta.dirname, '../../..');
const PATH = join(REPOSITORY, 'samples/conformance/balanced.ltgs');
const FILE = `/@fs/${PATH}`;
const WIDE = 'width: 200px; height: 100px; float: left';

interface Tools extends LossWindow {
    all: LitetexViewerElement[];
    /** Events of all elements, in their order. */
    events: string[];
    moves: number;
    /** Ends what makes reading slow. */
    hurry(): void;
}

describe.skipIf(!browserPath())('<litetex-viewer>', () => {
    let browser: BrowserTest;
    let server: Server;
    let other: string;
    /** Sends the rest of the files that have been asked for so far. */
    let finish: () => void = () => {};
    let isDown = false;
    beforeAll(async () => {
        const bytes = readFileSync(PATH);
        server = createServer((request, response) => {
            if (isDown) return void response.destroy();
            const allow = { 'Access-Control-Allow-Origin': '*' };
            if (request.url === '/closed') return void response.writeHead(200).end(bytes);
            if (request.url !== '/slow') return void response.writeHead(404, allow).end();
            response.writeHead(200, { ...allow, 'Content-Length': bytes.length }).write(bytes.subarray(0, bytes.length >> 1));
            const before = finish;
            finish = () => {
                before();
                response.end(bytes.subarray(bytes.length >> 1));
            };
        });
        await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
        other = `http://127.0.0.1:${(server.address() as AddressInfo).port}`;
        browser = await BrowserTest.open('tests/browser/element.html', [REPOSITORY], setUpLoss);
        await browser.page.setViewportSize({ width: 800, height: 600 });
    });
    afterAll(async () => {
        await browser?.close();
        finish();
        server?.close();
    });
    beforeEach(async () => {
        finish = () => {};
        isDown = false;
        await browser.page.evaluate(() => {
            document.body.replaceChildren();
            Object.assign(window, { all: [], events: [], moves: 0 });
        });
    });

    const add = (count: number, attributes: Record<string, string>, style = WIDE) => browser.page.evaluate(([n, given, css]) => {
        const tools = window as unknown as Tools;
        for (let i = 0; i < n; i++) {
            const element = document.createElement('litetex-viewer');
            for (const [name, value] of Object.entries(given)) element.setAttribute(name, value);
            element.style.cssText = css;
            element.addEventListener('load', () => tools.events.push('load'));
            element.addEventListener('error', (event) => tools.events.push((event as ErrorEvent).message));
            element.addEventListener('camera-change', () => tools.moves++);
            tools.all.push(element);
            document.body.append(element);
        }
    }, [count, attributes, style] as const);
    const events = () => browser.page.evaluate(() => (window as unknown as Tools).events);
    const happened = (expected: unknown[]) => expect.poll(events, { timeout: 20_000 }).toEqual(expected);
    const loads = (count: number) => happened(Array(count).fill('load'));
    const set = (name: string, value: string | null) => browser.page.evaluate(([attribute, text]) => {
        const [element] = (window as unknown as Tools).all;
        if (text === null) element.removeAttribute(attribute!);
        else element.setAttribute(attribute!, text);
    }, [name, value]);
    const failure = () => browser.page.evaluate(() => (window as unknown as Tools).all[0].shadowRoot!.querySelector('[part=error]')!.textContent);
    const contexts = () => browser.page.evaluate(() => (window as unknown as Tools).contexts());

    /** Whether the window shows an image of element `i`, in front of a green page. */
    async function isShown(i: number): Promise<boolean> {
        const clip = await browser.page.evaluate((index) => {
            const { x, y, width, height } = (window as unknown as Tools).all[index].getBoundingClientRect();
            return { x, y, width, height };
        }, i);
        return browser.page.evaluate(async (base64) => {
            const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
            const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
            context.drawImage(bitmap, 0, 0);
            const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
            return data.some((v, k) => k % 4 < 3 && Math.abs(v - (k % 4 === 1 ? 128 : 0)) > 40);
        }, (await browser.page.screenshot({ clip })).toString('base64'));
    }
    const shown = (i: number) => expect.poll(() => isShown(i), { timeout: 10_000 }).toBe(true);

    test('those that have no area leave the contexts to others, and draw once they have one', async () => {
        await add(7, { src: FILE }, 'width: 0; height: 100px; float: left');
        await loads(7);
        await add(7, { src: FILE }, 'display: none');
        await loads(14);
        await add(1, { src: FILE });
        await shown(14);
        await browser.page.evaluate((style) => { for (const element of (window as unknown as Tools).all) element.style.cssText = style; }, WIDE);
        for (let i = 0; i < 15; i++) await shown(i);
        expect(await contexts()).toBeLessThanOrEqual(6);
        expect(await events()).toEqual(Array(15).fill('load'));
    });

    test('one that gives its context up as it hears of `load` says so again when there is an image, not before', async () => {
        await browser.page.evaluate(() => {
            // Reading takes a while, as of a large file.
            const { prototype } = Worker;
            const post = prototype.postMessage as (this: Worker, ...args: unknown[]) => void;
            prototype.postMessage = function (this: Worker, ...args: unknown[]) {
                if ((args[0] as { kind: string }).kind === 'read') setTimeout(() => post.apply(this, args), 2000);
                else post.apply(this, args);
            } as typeof prototype.postMessage;
            (window as unknown as Tools).hurry = () => { prototype.postMessage = post as typeof prototype.postMessage; };
        });
        try {
            await add(1, { src: FILE });
            await browser.page.evaluate(() => {
                const [element] = (window as unknown as Tools).all;
                element.addEventListener('load', () => element.remove(), { once: true });
            });
            await loads(1);
            await browser.page.evaluate(() => document.body.append((window as unknown as Tools).all[0]));
            await loads(2);
            expect(await isShown(0)).toBe(true);
        } finally {
            await browser.page.evaluate(() => (window as unknown as Tools).hurry());
        }
    });

    test('without an address, nothing is shown any more', async () => {
        await add(1, { src: FILE });
        await loads(1);
        await shown(0);
        await set('src', null);
        expect(await isShown(0)).toBe(false);
        expect(await browser.page.evaluate(() => (window as unknown as Tools).all[0].info)).toBe(null);
        await expect(browser.page.evaluate(() => (window as unknown as Tools).all[0].toBlob())).rejects.toThrow('nothing is shown yet');
        // Nor is what had not arrived.
        await set('src', `${other}/slow`);
        await expect.poll(() => browser.page.evaluate(() => (window as unknown as Tools).all[0].info !== null), { timeout: 10_000 }).toBe(true);
        await set('src', null);
        finish();
        await browser.page.waitForTimeout(500);
        await loads(1);
        expect(await isShown(0)).toBe(false);
        await set('src', FILE);
        await loads(2);
        await shown(0);
    });

    test('an address that failed is tried again when it is set again', async () => {
        await add(1, {});
        isDown = true;
        await set('src', `${other}/slow`);
        await happened([expect.stringMatching(/^http.*\/slow: the server does not answer/)]);
        expect(await failure()).toMatch(/does not answer/);
        isDown = false;
        await set('src', `${other}/slow`);
        await expect.poll(() => browser.page.evaluate(() => (window as unknown as Tools).all[0].info !== null), { timeout: 10_000 }).toBe(true);
        finish();
        await happened([expect.anything(), 'load']);
        expect(await failure()).toBe('');
        await shown(0);
        // Negative control: one that did not fail is not read again.
        await set('src', `${other}/slow`);
        await browser.page.waitForTimeout(300);
        expect(await events()).toHaveLength(2);
        await set('src', `${other}/closed`);
        await happened([expect.anything(), 'load', expect.stringMatching(/\/closed: .*Access-Control-Allow-Origin/)]);
        await set('src', `${other}/none`);
        await happened([expect.anything(), 'load', expect.anything(), expect.stringMatching(/\/none: the server answers 404/)]);
        // The loss of the context is no news then.
        await browser.page.evaluate(async () => {
            const { all: [element], lose, restore } = window as unknown as Tools;
            const canvas = element.shadowRoot!.querySelector('canvas')!;
            await lose(canvas);
            await restore(canvas);
        });
        expect(await failure()).toMatch(/404/);
    });

    test('a context that cannot be had is asked for again with the next address', async () => {
        await browser.page.evaluate(() => {
            const { prototype } = HTMLCanvasElement;
            const get = prototype.getContext;
            prototype.getContext = (() => null) as unknown as typeof get;
            setTimeout(() => { prototype.getContext = get; }, 500);
        });
        await add(1, { src: FILE });
        await happened(['this browser has no WebGL2']);
        await browser.page.waitForTimeout(600);
        await set('src', `${FILE}?again`);
        await happened(['this browser has no WebGL2', 'load']);
        await shown(0);
        expect(await failure()).toBe('');
    });

    test('a context lost while a file arrives', async () => {
        await add(1, { src: `${other}/slow` });
        await expect.poll(() => browser.page.evaluate(() => (window as unknown as Tools).all[0].info !== null), { timeout: 10_000 }).toBe(true);
        const on = (what: 'lose' | 'restore') => browser.page.evaluate((name) => {
            const tools = window as unknown as Tools;
            return tools[name](tools.all[0].shadowRoot!.querySelector('canvas')!);
        }, what);
        await on('lose');
        finish();
        await browser.page.waitForTimeout(300);
        expect(await events()).toEqual([]);
        finish = () => {};
        await on('restore');
        await browser.page.waitForTimeout(300);
        await on('lose');
        await on('restore');
        await expect.poll(async () => { finish(); return events(); }, { timeout: 20_000 }).toEqual(['load']);
        await shown(0);
        expect(await browser.page.evaluate(() => (window as unknown as Tools).all[0].figures!.splats)).toBe(36);
    });

    test('bytes that are shown while a file arrives take its place, wherever they lie in memory', async () => {
        await add(1, { src: `${other}/slow` });
        await expect.poll(() => browser.page.evaluate(() => (window as unknown as Tools).all[0].info !== null), { timeout: 10_000 }).toBe(true);
        await browser.page.evaluate(async (url) => {
            const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
            const around = new Uint8Array(bytes.length + 20).fill(0xa5);
            around.set(bytes, 7);
            const [element] = (window as unknown as Tools).all;
            element.show(around.subarray(7, 7 + bytes.length));
            element.show(around.subarray(7, 7 + bytes.length));
            around.fill(0);
        }, FILE);
        finish();
        await loads(1);
        await browser.page.waitForTimeout(300);
        await loads(1);
        await shown(0);
    });

    test('what is held while it leaves the document is no longer held when it comes back', async () => {
        await add(1, { src: FILE, 'camera-controls': '', 'controls-mode': 'fly' });
        await loads(1);
        await shown(0);
        const { mouse, keyboard } = browser.page;
        const moves = () => browser.page.evaluate(() => (window as unknown as Tools).moves);
        await mouse.move(50, 50);
        await mouse.down();
        await keyboard.down('w');
        await browser.page.waitForTimeout(200);
        expect(await moves()).toBeGreaterThan(0);
        await browser.page.evaluate(() => (window as unknown as Tools).all[0].remove());
        await mouse.up();
        await keyboard.up('w');
        await browser.page.evaluate(() => document.body.append((window as unknown as Tools).all[0]));
        await loads(2);
        await shown(0);
        const before = await moves();
        await mouse.move(120, 70, { steps: 5 });
        await browser.page.waitForTimeout(300);
        expect(await moves()).toBe(before);
        // Negative control.
        await mouse.down();
        await mouse.move(140, 75, { steps: 3 });
        await mouse.up();
        expect(await moves()).toBeGreaterThan(before);
    });

    test('20 that come and go, five times', async () => {
        const warnings: string[] = [];
        browser.page.on('console', (message) => warnings.push(message.text()));
        for (let i = 0; i < 5; i++) {
            await add(20, { src: FILE, 'auto-rotate': '' }, 'width: 150px; height: 100px; float: left');
            await browser.page.waitForTimeout(150);
            await browser.page.evaluate(() => {
                document.body.replaceChildren();
                Object.assign(window, { all: [], events: [] });
            });
        }
        await expect.poll(contexts, { timeout: 10_000 }).toBe(0);
        await add(20, { src: FILE }, 'width: 150px; height: 100px; float: left');
        await expect.poll(async () => (await browser.page.evaluate(() => (window as unknown as Tools).all.filter((element) => element.info).length)), { timeout: 60_000 }).toBe(20);
        for (const i of [0, 7, 19]) await shown(i);
        expect(await contexts()).toBeLessThanOrEqual(6);
        expect(warnings.filter((text) => /too many/i.test(text))).toEqual([]);
    }, 240_000);

    test('the page shows no errors but those of the network', () => {
        expect(browser.errors.filter((error) => !/Failed to load resource|CORS policy/.test(error))).toEqual([]);
    });
});
