/** `<litetex-viewer>` in a page. */

import { join } from 'node:path';
import { afterAll, beforeAll, beforeEach, describe, expect, test } from 'vitest';
import { BrowserTest, browserPath } from './browser';

const REPOSITORY = join(import.meta.dirname, '../../..');
const FILE = `/@fs/${join(REPOSITORY, 'samples/conformance/balanced.ltgs')}`;

describe.skipIf(!browserPath())('<litetex-viewer>', () => {
    let browser: BrowserTest;
    beforeAll(async () => { browser = await BrowserTest.open('tests/browser/element.html', [REPOSITORY]); });
    afterAll(() => browser?.close());
    beforeEach(() => browser.page.evaluate(() => document.body.replaceChildren()));

    /** Adds an element, waits for one of its events, and gives what `then` says of it. */
    function show<T>(attributes: Record<string, string>, event: string, then: string): Promise<T> {
        return browser.page.evaluate(async ([given, name, code]) => {
            const element = document.createElement('litetex-viewer');
            for (const [key, value] of Object.entries(given)) element.setAttribute(key, value);
            const happened = new Promise<unknown>((resolve) => element.addEventListener(name, resolve, { once: true }));
            document.body.append(element);
            const event = await happened;
            await new Promise((resolve) => setTimeout(resolve, 300));
            // eslint-disable-next-line no-new-func -- the test's own code
            return await new Function('element', 'event', `return (async () => { ${code} })()`)(element, event);
        }, [attributes, event, then] as const) as Promise<T>;
    }

    /** Mean RGBA of the image. */
    const MEAN = `
        const bitmap = await createImageBitmap(await element.toBlob());
        const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
        const context = canvas.getContext('2d');
        context.drawImage(bitmap, 0, 0);
        const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
        const mean = [0, 1, 2, 3].map((c) => data.reduce((sum, v, i) => sum + (i % 4 === c ? v : 0), 0) / (data.length / 4));
        return { mean, size: [bitmap.width, bitmap.height] };`;

    test('shows a file, at the camera that is named', async () => {
        const wide = await show<{ mean: number[]; size: number[] }>({ src: FILE, view: 'wide' }, 'load', MEAN);
        expect(wide.size).toEqual([200, 150]);
        expect(wide.mean[3]).toBe(255);
        const side = await show<{ mean: number[] }>({ src: FILE, view: 'side' }, 'load', MEAN);
        expect(Math.hypot(...wide.mean.map((v, i) => v - side.mean[i]))).toBeGreaterThan(3);
    });

    test('tells what the file says', async () => {
        expect(await show({ src: FILE }, 'load', 'return [element.info.splats, element.info.cameras.map((c) => c.name)]')).toEqual([36, ['wide', 'side', 'inside']]);
        expect(await show({ src: FILE }, 'progress', 'return event.total > 1000 && event.loaded <= event.total')).toBe(true);
    });

    test('lets the page through where it is transparent', async () => {
        const { mean } = await show<{ mean: number[] }>({ src: FILE, background: 'transparent' }, 'load', MEAN);
        expect(mean[3]).toBeGreaterThan(5);
        expect(mean[3]).toBeLessThan(250);
    });

    test('shows fewer splats on request', async () => {
        expect(await show({ src: FILE, 'max-splats': '5' }, 'load', 'return element.figures.splats')).toBe(5);
        expect(await show({ src: FILE }, 'load', 'return element.figures.splats')).toBe(36);
    });

    test('says why it shows nothing', async () => {
        const message = (src: string) => show<string>({ src }, 'error', 'return event.message');
        expect(await message(`/@fs/${join(REPOSITORY, 'README.md')}`)).toMatch(/expected \.ltgs or \.glb/);
        expect(await message('/nothing.ltgs')).toMatch(/nothing\.ltgs|expected/);
        expect(await message('http://[bad')).toMatch(/URL/);
    });

    test('takes bytes, and odd numbers of splats', async () => {
        const bytes = "await (await fetch('" + FILE + "')).arrayBuffer()";
        const again = `const bytes = BYTES, done = new Promise((resolve) => element.addEventListener('load', resolve, { once: true })); element.show(bytes); await done; return element.figures.splats;`;
        expect(await show({ src: FILE, 'max-splats': '-3' }, 'load', again.replace('BYTES', `new Uint8Array(${bytes})`))).toBe(36);
        expect(await show({ src: FILE, 'max-splats': '2.5' }, 'load', again.replace('BYTES', bytes))).toBe(2);
    });

    test('moves by mouse and keys only where controls are wanted', async () => {
        const counted = async (attributes: Record<string, string>) => {
            await show({ src: FILE, ...attributes }, 'load', 'window.moves = 0; element.addEventListener("camera-change", () => window.moves++); return null');
            await browser.page.mouse.move(100, 75);
            await browser.page.mouse.down();
            await browser.page.mouse.move(130, 80, { steps: 3 });
            await browser.page.mouse.up();
            await browser.page.keyboard.press('KeyW', { delay: 50 });
            return browser.page.evaluate(() => Reflect.get(window, 'moves') as number);
        };
        expect(await counted({ 'camera-controls': '' })).toBeGreaterThan(3);
        await browser.page.evaluate(() => document.body.replaceChildren());
        expect(await counted({})).toBe(0);
        await browser.page.evaluate(() => document.body.replaceChildren());
        expect(await counted({ 'camera-controls': 'false' })).toBe(0);
    });

    test('turns by itself', async () => {
        const turns = (value: string) => show({ src: FILE, 'auto-rotate': value }, 'load', 'let moves = 0; element.addEventListener("camera-change", () => moves++); await new Promise((r) => setTimeout(r, 400)); return moves > 1');
        expect(await turns('')).toBe(true);
        expect(await turns('false')).toBe(false);
    });

    test('shows nothing once its address is taken away', async () => {
        const take = (what: string) => show<string>({ src: FILE }, 'load', `
            const { splats } = element.info;
            element.src = ${what};
            await new Promise((resolve) => setTimeout(resolve, 300));
            return [splats, element.hasAttribute('src'), element.info, await element.toBlob().catch((error) => error.message)].join()`);
        for (const nothing of ['undefined', 'null', "''"]) expect(await take(nothing)).toBe(`36,${nothing === "''"},,nothing is shown yet`);
    });

    test('can be removed, put back, and added many times', async () => {
        const mean = await show<number>({ src: FILE }, 'load', `
            let errors = 0;
            element.addEventListener('error', () => errors++);
            for (let i = 0; i < 20; i++) { element.remove(); document.body.append(element); }
            await new Promise((resolve) => element.addEventListener('load', resolve, { once: true }));
            await new Promise((resolve) => setTimeout(resolve, 300));
            return errors ? 0 : (await element.toBlob()).size;`);
        expect(mean).toBeGreaterThan(1000);
    });

    test('the page shows no errors', () => expect(browser.errors.filter((error) => !/404/.test(error))).toEqual([]));
});
