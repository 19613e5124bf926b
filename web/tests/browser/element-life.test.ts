/** What browsers, pages and people do to `<litetex-viewer>` while it shows a scene. */

import { join } from 'node:path';
import { afterAll, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import type { LitetexViewerElement } from '../../src/element';
import { BrowserTest, browserPath } from './browser';
import { type LossWindow, setUpLoss } from './context';

const REPOSITORY = join(import.meta.dirname, '../../..');
const FILE = `/@fs/${join(REPOSITORY, 'samples/conformance/balanced.ltgs')}`;
/** As many as the element takes at most. */
const MOST = 6;

/** What the functions below add to the page. */
interface Tools extends LossWindow {
    add(count: number, attributes: Record<string, string>, size?: string): LitetexViewerElement[];
    moves: number;
    loads: number;
}

describe.skipIf(!browserPath())('<litetex-viewer>', () => {
    let browser: BrowserTest;
    let warnings: string[];
    beforeAll(async () => {
        browser = await BrowserTest.open('tests/browser/element.html', [REPOSITORY], setUpLoss);
        browser.page.on('console', (message) => warnings.push(message.text()));
        await browser.page.setViewportSize({ width: 800, height: 600 });
        await browser.page.evaluate(() => Object.assign(window, {
            moves: 0,
            loads: 0,
            add: (count: number, attributes: Record<string, string>, size = '') => Array.from({ length: count }, () => {
                const element = document.createElement('litetex-viewer');
                for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
                element.style.cssText = size;
                element.addEventListener('load', () => (window as unknown as Tools).loads++);
                element.addEventListener('camera-change', () => (window as unknown as Tools).moves++);
                document.body.append(element);
                return element;
            }),
        }));
    });
    afterAll(() => browser?.close());
    beforeEach(async () => {
        warnings = [];
        await browser.page.emulateMedia({ reducedMotion: 'no-preference' });
        await browser.page.evaluate(() => {
            document.body.replaceChildren();
            Object.assign(window, { moves: 0, loads: 0 });
            scrollTo(0, 0);
        });
    });

    const add = (count: number, attributes: Record<string, string>, size = '') =>
        browser.page.evaluate(([n, given, style]) => void (window as unknown as Tools).add(n, given, style), [count, attributes, size] as const);
    const number = (what: 'moves' | 'loads') => browser.page.evaluate((name) => (window as unknown as Tools)[name], what);
    const contexts = () => browser.page.evaluate(() => (window as unknown as Tools).contexts());
    const loaded = (count: number) => expect.poll(() => number('loads'), { timeout: 60_000 }).toBe(count);
    const rest = () => browser.page.waitForTimeout(400);
    /** Waits until element `i`, which someone has moved, glides no longer and is sharp again. */
    async function untilStill(i: number): Promise<void> {
        let [before, now]: number[][] = [EMPTY, await shown(i)];
        for (; farthest(before, now) > 0; [before, now] = [now, await shown(i)]) await browser.page.waitForTimeout(1000);
    }
    /** Whether element `i` has a context, and shows no still image. */
    const isLive = (i: number) => browser.page.evaluate((index) => {
        const { shadowRoot } = document.querySelectorAll('litetex-viewer')[index];
        return !shadowRoot!.querySelector('canvas')!.getContext('webgl2')!.isContextLost() && shadowRoot!.querySelector<HTMLElement>('.still')?.hidden !== false;
    }, i);

    /** Sums of what the window shows of element `i`: colours of four columns. The page behind it is green. */
    async function shown(i: number): Promise<number[]> {
        const clip = await browser.page.evaluate((index) => {
            const { x, y, width, height } = document.querySelectorAll('litetex-viewer')[index].getBoundingClientRect();
            return { x, y, width, height };
        }, i);
        return sums((await browser.page.screenshot({ clip })).toString('base64'));
    }

    const sums = (png: string) => browser.page.evaluate(async (base64) => {
        const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${base64}`)).blob());
        const context = new OffscreenCanvas(4, 3).getContext('2d')!;
        context.drawImage(bitmap, 0, 0, 4, 3);
        return [...context.getImageData(0, 0, 4, 3).data].filter((_, k) => k % 4 < 3);
    }, png);

    const farthest = (a: number[], b: number[]) => Math.max(...a.map((v, k) => Math.abs(v - b[k])));
    const EMPTY: number[] = Array.from({ length: 36 }, (_, k) => (k % 3 === 1 ? 128 : 0));

    test('20 on one page all show their picture, with six contexts', async () => {
        await add(1, { src: FILE });
        await loaded(1);
        await rest();
        const expected = await shown(0);
        expect(farthest(expected, EMPTY)).toBeGreaterThan(30);
        await browser.page.evaluate(() => { document.body.replaceChildren(); (window as unknown as Tools).loads = 0; });

        await add(20, { src: FILE, 'camera-controls': '' });
        await loaded(20);
        await rest();
        expect(await contexts()).toBeLessThanOrEqual(MOST);
        for (const i of [...Array(20).keys(), 0, 10]) {
            await browser.page.evaluate((index) => document.querySelectorAll('litetex-viewer')[index].scrollIntoView(), i);
            // At once: the still image, until the context is back.
            expect([i, farthest(await shown(i), expected)]).toEqual([i, expect.toSatisfy((d: number) => d <= 3)]);
            await expect.poll(() => isLive(i), { timeout: 10_000 }).toBe(true);
            expect([i, farthest(await shown(i), expected)]).toEqual([i, expect.toSatisfy((d: number) => d <= 3)]);
        }
        expect(await contexts()).toBeLessThanOrEqual(MOST);
        // Visible again, it is moved as before.
        await browser.page.mouse.move(50, 50);
        const place = await browser.page.evaluate(() => document.querySelectorAll('litetex-viewer')[10].getBoundingClientRect().y);
        await browser.page.mouse.move(100, place + 70);
        await browser.page.mouse.down();
        await browser.page.mouse.move(160, place + 80, { steps: 3 });
        await browser.page.mouse.up();
        await untilStill(10);
        expect(farthest(await shown(10), expected)).toBeGreaterThan(5);
        // No longer visible, and visible again: as it was left.
        const left = await shown(10);
        await browser.page.evaluate(() => scrollTo(0, 0));
        for (let i = 0; i < 6; i++) {
            await browser.page.evaluate((index) => document.querySelectorAll('litetex-viewer')[index].scrollIntoView(), i);
            await expect.poll(() => isLive(i), { timeout: 10_000 }).toBe(true);
        }
        expect(await isLive(10)).toBe(false);
        await browser.page.evaluate(() => document.querySelectorAll('litetex-viewer')[10].scrollIntoView());
        expect(farthest(await shown(10), left)).toBeLessThanOrEqual(3);
        expect(warnings.filter((text) => /too many/i.test(text))).toEqual([]);
        // Of all loads, none was repeated for those who listen.
        expect(await number('loads')).toBe(20);
    }, 240_000);

    test('20 visible at once all show their picture; one that is taken hold of moves', async () => {
        await add(20, { src: FILE, 'camera-controls': '' }, 'width: 150px; height: 100px; float: left');
        await loaded(20);
        await rest();
        expect(await contexts()).toBeLessThanOrEqual(MOST);
        const images: number[][] = [];
        for (let i = 0; i < 20; i++) images.push(await shown(i));
        for (const image of images) {
            expect(farthest(image, EMPTY)).toBeGreaterThan(30);
            expect(farthest(image, images[19])).toBeLessThanOrEqual(3);
        }
        const still = (await Promise.all(images.map((_, i) => isLive(i)))).indexOf(false);
        const blobs = await browser.page.evaluate(async (index) => {
            const elements = document.querySelectorAll('litetex-viewer');
            return Promise.all([index, 19].map(async (i) => {
                const text: string = await elements[i].toBlob().then((blob) => new Promise((resolve) => {
                    const reader = new FileReader();
                    reader.onload = () => resolve(reader.result as string);
                    reader.readAsDataURL(blob);
                }));
                return text.split(',')[1];
            }));
        }, still);
        expect(farthest(await sums(blobs[0]), await sums(blobs[1]))).toBeLessThanOrEqual(1);
        const { x, y } = await browser.page.evaluate((i) => document.querySelectorAll('litetex-viewer')[i].getBoundingClientRect().toJSON(), still);
        await browser.page.mouse.move(x + 50, y + 50);
        await browser.page.mouse.down();
        await browser.page.mouse.move(x + 90, y + 60, { steps: 3 });
        await browser.page.mouse.up();
        await expect.poll(() => isLive(still), { timeout: 10_000 }).toBe(true);
        await rest();
        expect(farthest(await shown(still), images[still])).toBeGreaterThan(5);
        expect(await contexts()).toBeLessThanOrEqual(MOST);
        // What is drawn otherwise takes a context, too.
        const other = (await Promise.all(images.map((_, i) => isLive(i)))).indexOf(false);
        await browser.page.evaluate((i) => document.querySelectorAll('litetex-viewer')[i].setAttribute('colours', 'depth'), other);
        await expect.poll(() => isLive(other), { timeout: 10_000 }).toBe(true);
        expect(farthest(await shown(other), images[other])).toBeGreaterThan(5);
    }, 240_000);

    test('comes back after the loss of its context, as often as that happens', async () => {
        await add(1, { src: FILE });
        await loaded(1);
        await rest();
        const before = await shown(0);
        const on = (what: 'lose' | 'restore') => browser.page.evaluate((name) => (window as unknown as Tools)[name](document.querySelector('litetex-viewer')!.shadowRoot!.querySelector('canvas')!), what);
        const failure = () => browser.page.evaluate(() => document.querySelector('litetex-viewer')!.shadowRoot!.querySelector('[part=error]')!.textContent);
        for (let i = 0; i < 3; i++) {
            await on('lose');
            expect(await failure()).toMatch(/driver has stopped/);
            expect(farthest(await shown(0), before)).toBeGreaterThan(30);
            await on('restore');
            expect(await failure()).toBe('');
            await expect.poll(async () => farthest(await shown(0), before), { timeout: 10_000 }).toBeLessThanOrEqual(1);
        }
        expect(await number('loads')).toBe(1);
        expect(await browser.page.evaluate(() => document.querySelector('litetex-viewer')!.figures!.splats)).toBe(36);
    });

    test('what was given as bytes survives a move in the document, while and after it is read', async () => {
        const [first, then] = await browser.page.evaluate(async (url) => {
            const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
            const [element] = (window as unknown as Tools).add(1, {});
            const box = document.createElement('div');
            document.body.append(box);
            const load = () => new Promise((resolve) => element.addEventListener('load', resolve, { once: true }));
            const again = load();
            element.show(bytes);
            box.append(element); // before it is read
            await again;
            const early = element.figures!.splats;
            const moved = load();
            document.body.append(element);
            await moved;
            return [early, element.figures!.splats];
        }, FILE);
        expect([first, then]).toEqual([36, 36]);
        await rest();
        expect(farthest(await shown(0), EMPTY)).toBeGreaterThan(30);
    });

    test('a move asks nobody for the file again, and keeps the camera', async () => {
        await add(1, { src: `${FILE}?once`, 'camera-controls': '' });
        await loaded(1);
        await browser.page.evaluate(() => document.querySelector('litetex-viewer')!.goTo('side'));
        await rest();
        const before = await shown(0);
        const asked: string[] = [];
        const listen = (request: { url(): string }) => { asked.push(request.url()); };
        browser.page.on('request', listen);
        await browser.page.evaluate(() => {
            const box = document.createElement('div');
            document.body.append(box);
            box.append(document.querySelector('litetex-viewer')!);
        });
        await loaded(2);
        await rest();
        browser.page.off('request', listen);
        expect(farthest(await shown(0), before)).toBeLessThanOrEqual(1);
        expect(asked.filter((url) => url.includes('once'))).toEqual([]);
    });

    test('another number of splats is obeyed, and kept when the context is lost', async () => {
        const splats = () => browser.page.evaluate(() => document.querySelector('litetex-viewer')!.figures!.splats);
        await add(1, { src: FILE, 'max-splats': '5' });
        await loaded(1);
        await rest();
        const few = await shown(0);
        await browser.page.evaluate(async () => {
            const { lose, restore } = window as unknown as Tools;
            const canvas = document.querySelector('litetex-viewer')!.shadowRoot!.querySelector('canvas')!;
            await lose(canvas);
            await restore(canvas);
        });
        await expect.poll(async () => farthest(await shown(0), few), { timeout: 10_000 }).toBeLessThanOrEqual(1);
        expect(await splats()).toBe(5);
        await browser.page.evaluate(() => document.querySelector('litetex-viewer')!.removeAttribute('max-splats'));
        await loaded(2);
        expect(await splats()).toBe(36);
    });

    test('what is lazy loads once it is visible', async () => {
        await browser.page.evaluate(() => document.body.append(Object.assign(document.createElement('div'), { style: 'height: 2000px' })));
        await add(2, { src: FILE, loading: 'lazy' });
        await browser.page.waitForTimeout(1000);
        expect(await number('loads')).toBe(0);
        await browser.page.evaluate(() => document.querySelector('litetex-viewer')!.scrollIntoView());
        await loaded(2);
    });

    test('auto-rotate turns until someone takes hold of it, and again when it is set again', async () => {
        /** Whether the camera moves by itself. */
        const turns = async () => {
            await browser.page.waitForTimeout(200);
            const before = await number('moves');
            await browser.page.waitForTimeout(500);
            return await number('moves') > before;
        };
        const set = (attributes: Record<string, string | null>) => browser.page.evaluate((given) => {
            const element = document.querySelector('litetex-viewer')!;
            for (const [name, value] of Object.entries(given)) value === null ? element.removeAttribute(name) : element.setAttribute(name, value);
        }, attributes);
        const hold = () => browser.page.mouse.click(100, 75);
        await add(1, { src: FILE, 'auto-rotate': '', 'camera-controls': '' });
        await loaded(1);
        expect(await turns()).toBe(true);
        await set({ colours: 'depth', 'rotation-per-second': '30' });
        expect(await turns()).toBe(true);
        for (let i = 0; i < 2; i++) {
            await hold();
            expect(await turns()).toBe(false);
            await set({ colours: 'trained', alt: `after ${i}`, 'rotation-per-second': '20' });
            expect(await turns()).toBe(false);
            await set({ 'auto-rotate': null });
            await set({ 'auto-rotate': '' });
            expect(await turns()).toBe(true);
        }
        await browser.page.evaluate(() => document.querySelector('litetex-viewer')!.shadowRoot!.querySelector('canvas')!.focus());
        await browser.page.keyboard.down('ArrowLeft');
        await browser.page.waitForTimeout(300);
        await browser.page.keyboard.up('ArrowLeft');
        expect(await turns()).toBe(false);
        await set({ 'auto-rotate': '' });
        expect(await turns()).toBe(true);
        await browser.page.emulateMedia({ reducedMotion: 'reduce' });
        expect(await turns()).toBe(false);
        await set({ 'rotation-per-second': '40' });
        expect(await turns()).toBe(false);
        await browser.page.emulateMedia({ reducedMotion: 'no-preference' });
        expect(await turns()).toBe(true);
        await set({ 'auto-rotate': null });
        expect(await turns()).toBe(false);
    });

    test('keys move the camera wherever in the element the focus is, but not in a field or elsewhere on the page', async () => {
        await add(1, { src: FILE, 'camera-controls': '', 'controls-mode': 'fly' });
        await loaded(1);
        await browser.page.evaluate(() => {
            const markup = '<button id="inside">a</button><input id="field">';
            document.querySelector('litetex-viewer')!.append(document.createRange().createContextualFragment(markup));
            document.body.append(document.createRange().createContextualFragment('<button id="outside">b</button>'));
        });
        const moves = async (selector: string, key: string) => {
            await browser.page.evaluate((wanted) => document.querySelector<HTMLElement>(wanted)!.focus(), selector);
            const before = await number('moves');
            await browser.page.keyboard.down(key);
            await browser.page.waitForTimeout(500);
            await browser.page.keyboard.up(key);
            return await number('moves') > before;
        };
        expect([await moves('#inside', 'w'), await moves('#inside', 'ArrowLeft')]).toEqual([true, false]);
        expect(await moves('#field', 'w')).toBe(false);
        expect(await moves('#outside', 'w')).toBe(false);
    });

    test('the page shows no errors', () => expect(browser.errors).toEqual([]));
});
