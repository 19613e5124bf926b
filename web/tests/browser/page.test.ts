/** The built page, served and as a file, under the policy that the program gives it. */

import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { BrowserTest, browserPath, WEB } from './browser';
import { difference, PageDriver, quiet, type Raster, renamed, says, text } from './page-driver';
import { exported } from './page-server';

const PACK = join(WEB, '../samples/conformance');
const LTGS = readFileSync(join(PACK, 'balanced.ltgs'));
const GLB = readFileSync(join(PACK, 'balanced.glb'));
const HOSTILE = '</script><img src=x onerror="document.title=1"><b>';

const hidden = (page: Page, id: string) => page.evaluate((which) => document.getElementById(which)!.hidden, id);
const cameraIs = (page: Page, name: string) => page.waitForFunction((wanted) => document.getElementById('camera-name')!.textContent === wanted, name);

/** Drops a file on the page. */
async function drop(page: Page, name: string, bytes: Buffer): Promise<void> {
    const transfer = await page.evaluateHandle(([fileName, base64]) => {
        const data = new DataTransfer();
        data.items.add(new File([Uint8Array.from(atob(base64), (c) => c.charCodeAt(0))], fileName));
        return data;
    }, [name, bytes.toString('base64')]);
    for (const event of ['dragover', 'drop']) await page.dispatchEvent('body', event, { dataTransfer: transfer });
}

async function drag(page: Page, dx: number, dy: number): Promise<void> {
    await page.mouse.move(200, 200);
    await page.mouse.down();
    await page.mouse.move(200 + dx, 200 + dy, { steps: 4 });
    await page.mouse.up();
}

/** Counts the batches of splats of every draw call, in `window.draws`. */
function countDraws(): void {
    const draws: number[] = [];
    Object.assign(window, { draws });
    const { prototype } = WebGL2RenderingContext;
    const draw = prototype.drawElementsInstanced;
    prototype.drawElementsInstanced = function (...args) {
        draws.push(args[4]);
        return draw.apply(this, args);
    };
}
const draws = (page: Page) => page.evaluate(() => (window as unknown as { draws: number[] }).draws);

describe.skipIf(!browserPath())('page', () => {
    let driver: PageDriver;
    let renderer: BrowserTest;
    const folder = mkdtempSync(join(tmpdir(), 'page-'));

    beforeAll(async () => {
        driver = await PageDriver.start();
        renderer = await BrowserTest.open('tests/browser/harness.html', [PACK]);
    });
    afterAll(async () => {
        await driver?.close();
        await renderer?.close();
        rmSync(folder, { recursive: true });
    });

    test('draws each camera as the renderer does, and is moved by mouse and keys', async () => {
        const server = await driver.serve(LTGS);
        const opened = await driver.open(server.url, { init: countDraws });
        const { page } = opened;
        const expected = (name: string): Promise<Raster> => rendered(renderer, join(PACK, 'balanced.ltgs'), name, 800, 600).then((png) => driver.decode(png));
        const wide = await driver.canvas(page);
        expect(wide.name).toBe('Conformance-scene-wide.png');
        expect([wide.width, wide.height]).toEqual([800, 600]);
        expect(difference(wide, await expected('wide')).largest).toBe(0);
        expect(difference(await driver.window(page), wide).largest).toBeLessThanOrEqual(1);

        await page.click('#tool-cameras');
        await page.click('#cameras button:has-text("side")');
        await cameraIs(page, 'side');
        const side = await driver.canvas(page);
        expect(side.name).toBe('Conformance-scene-side.png');
        expect(difference(side, await expected('side')).largest).toBeLessThanOrEqual(1); // a pose is kept as its centre, which rounds
        expect(difference(side, wide).mean).toBeGreaterThan(5);

        await page.keyboard.press('n');
        await cameraIs(page, 'inside');
        expect(difference(await driver.canvas(page), await expected('inside')).largest).toBeLessThanOrEqual(1);
        await page.keyboard.press('p');
        await page.keyboard.press('p');
        await cameraIs(page, 'wide');
        expect(difference(await driver.canvas(page), wide).largest).toBe(0);

        await drag(page, 80, 30);
        await cameraIs(page, 'wideback');
        const moved = await driver.canvas(page);
        expect(moved.name).toBe('Conformance-scene.png');
        expect(difference(moved, wide).mean).toBeGreaterThan(2);
        await page.keyboard.press('b');
        await cameraIs(page, 'wide');
        await page.focus('#canvas');
        await page.keyboard.down('w');
        await cameraIs(page, 'wideback');
        await page.keyboard.up('w');
        await page.click('#camera-name');
        await cameraIs(page, 'wide');
        expect(difference(await driver.canvas(page), wide).largest).toBe(0);
        // A camera at rest costs nothing.
        await page.waitForTimeout(1000);
        const drawn = (await draws(page)).length;
        expect(drawn).toBeGreaterThan(0);
        await page.waitForTimeout(1000);
        expect((await draws(page)).length).toBe(drawn);
        quiet(opened, server.origin);
    });

    test('compares with the scene without textures, on either side of the divider', async () => {
        const server = await driver.serve(LTGS);
        const opened = await driver.open(server.url);
        const { page } = opened;
        const trained = await driver.canvas(page);
        await page.keyboard.press('2');
        const untextured = await driver.canvas(page);
        await page.keyboard.press('1');
        expect(difference(trained, untextured, [0, 400]).mean).toBeGreaterThan(0.2);
        await page.keyboard.press('c');
        const halves = await driver.canvas(page);
        expect(difference(halves, trained, [0, 400]).largest).toBe(0);
        expect(difference(halves, untextured, [400, 800]).largest).toBe(0);
        await page.mouse.move(400, 300);
        await page.mouse.down();
        await page.mouse.move(240, 300, { steps: 3 });
        await page.mouse.up();
        const shifted = await driver.canvas(page);
        expect(difference(shifted, trained, [0, 240]).largest).toBe(0);
        expect(difference(shifted, untextured, [240, 800]).largest).toBe(0);
        await page.focus('#slider');
        await page.keyboard.press('End');
        expect(await page.getAttribute('#slider', 'aria-valuenow')).toBe('100');
        expect(difference(await driver.canvas(page), trained).largest).toBe(0);
        await page.keyboard.press('c');
        expect(await hidden(page, 'slider')).toBe(true);
        for (const [key, legend] of [['3', 'none248163264128256+'], ['4', '0123'], ['5', 'nearfar']]) {
            await page.keyboard.press(key);
            expect(await text(page, 'legend-classes')).toBe(legend);
            expect(difference(await driver.canvas(page), trained).mean).toBeGreaterThan(2);
        }
        await page.keyboard.press('1');
        expect(await hidden(page, 'legend')).toBe(true);
        quiet(opened, server.origin);
    });

    test('lays the photo over exactly the image of its camera, and only there', async () => {
        const plain = await driver.open((await driver.serve(LTGS)).url);
        await plain.page.click('#tool-cameras');
        await plain.page.click('#cameras button:has-text("side")');
        const side = await driver.window(plain.page);
        // The camera's image lies in the middle of the window: 84 x 92 px at a scale of 600 / 92.
        const width = 84 * 600 / 92, left = 400 - width / 2;
        const clip = { x: Math.ceil(left), y: 0, width: Math.floor(width) - 1, height: 600 };
        const photo = await rendered(renderer, join(PACK, 'balanced.ltgs'), 'side', 7 * 84, 7 * 92);
        const server = await driver.serve(LTGS, (s) => {
            s.addPhoto('side', photo);
            s.addPhoto('wide', Buffer.from('not an image, but long enough for a header of one'));
        });
        const opened = await driver.open(server.url);
        const { page } = opened;
        await page.click('#tool-compare');
        await page.click('label:has-text("photo of the camera")');
        await says(page, 'The photo of wide cannot be read.');
        await page.keyboard.press('n');
        await page.waitForFunction(() => !document.getElementById('photo')!.hidden);
        await page.keyboard.press('Escape');
        const box = (await page.locator('#photo').boundingBox())!;
        expect(box.x).toBeCloseTo(left, 1);
        expect(box.width).toBeCloseTo(width, 1);
        expect([box.y, box.height]).toEqual([0, 600]);
        const over = await driver.window(page);
        expect(difference(over, side, [0, 398]).largest).toBe(0);
        expect(difference(over, side, [clip.x + clip.width + 2, 800]).largest).toBe(0);
        // The photo is the same image, resampled. One px off, it would fit worse.
        const inside: [number, number] = [402, clip.x + clip.width - 20];
        const inPlace = difference(over, side, inside).mean;
        expect(inPlace).toBeGreaterThan(0);
        for (const by of [-1, 1]) expect(difference(shiftedBy(over, by), side, inside).mean).toBeGreaterThan(1.5 * inPlace);

        await drag(page, 30, 0);
        await page.waitForFunction(() => document.getElementById('photo')!.hidden && document.getElementById('slider')!.hidden);
        expect(await text(page, 'camera-name')).toBe('sideback to the photo');
        await page.click('#camera-name');
        await page.waitForFunction(() => !document.getElementById('photo')!.hidden);
        await page.keyboard.press('n');
        await says(page, 'There is no photo of inside.');
        quiet(opened, server.origin);
    });

    test('takes the photo away when something else is compared, or another file is shown', async () => {
        const photo = await rendered(renderer, join(PACK, 'balanced.ltgs'), 'wide', 400, 300);
        const server = await driver.serve(LTGS, (s) => s.addPhoto('wide', photo));
        const opened = await driver.open(server.url);
        const { page } = opened;
        await page.click('#tool-compare');
        const compare = (what: string) => page.click(`label:has-text("${what}")`);
        const photoShown = () => page.waitForFunction(() => !document.getElementById('photo')!.hidden);
        await compare('photo of the camera');
        await photoShown();
        expect(await text(page, 'right-side')).toBe('photo');
        await compare('scene without textures');
        expect(await hidden(page, 'photo')).toBe(true);
        expect(await hidden(page, 'slider')).toBe(false);
        expect(await text(page, 'right-side')).toBe('without textures');
        await compare('photo of the camera');
        await photoShown();
        await compare('Nothing');
        expect([await hidden(page, 'photo'), await hidden(page, 'slider')]).toEqual([true, true]);
        await compare('photo of the camera');
        await photoShown();
        await drop(page, 'mine.glb', GLB);
        await page.waitForFunction(() => document.getElementById('subtitle')!.textContent!.includes('mine.glb'));
        expect(await hidden(page, 'photo')).toBe(true);
        quiet(opened, server.origin);
    });

    test('opens files that are dropped, says why it cannot, and keeps the scene then', async () => {
        const opened = await driver.open(pathToFileURL(join(WEB, '../exporters/page/view.html')).href, { wait: false });
        const { page } = opened;
        await page.waitForSelector('#welcome:not([hidden])');
        expect(await page.isDisabled('#tool-cameras')).toBe(true);
        await drop(page, 'rubbish.ltgs', Buffer.from('neither this nor that, but some bytes'));
        await says(page, 'rubbish.ltgs: ');
        await drop(page, 'photo.png', Buffer.from('\x89PNG\r\n\x1a\n', 'latin1'));
        await says(page, 'photo.png: file: found an image, expected .ltgs or .glb');
        await drop(page, 'scene.html', Buffer.from(exported(LTGS, '')));
        await says(page, 'scene.html is a page of its own: open it in the browser');
        const quads = (key: string, value: unknown) => (key === 'primitives' ? [{ attributes: {}, extras: { litetex: { kind: 'quads' } } }] : value);
        await drop(page, 'scene.mesh.glb', renamed(GLB, quads));
        await says(page, 'scene.mesh.glb: this is a mesh of quads for programs that know no splats: open the .glb');
        expect(await hidden(page, 'welcome')).toBe(false);
        await drop(page, 'scene.glb', GLB);
        await driver.drawn(page);
        expect(await hidden(page, 'welcome')).toBe(true);
        expect(await text(page, 'messages')).toBe('');
        const before = await driver.canvas(page);
        expect(difference(before, { ...before, data: Buffer.alloc(before.data.length, before.data.subarray(0, 4)) }).mean).toBeGreaterThan(2);
        for (const [name, bytes] of [['cut.ltgs', LTGS.subarray(0, 9000)], ['empty.glb', Buffer.alloc(0)], ['cut.glb', GLB.subarray(0, 20_000)]] as const) {
            await drop(page, name, bytes);
            await says(page, `${name}: `);
            expect(difference(await driver.canvas(page), before).largest).toBe(0);
            expect(await text(page, 'subtitle')).toContain('scene.glb');
            await page.keyboard.press('Escape');
        }
        await drop(page, 'other.ltgs', LTGS);
        await page.waitForFunction(() => document.getElementById('subtitle')!.textContent!.includes('other.ltgs'));
        expect(await text(page, 'messages')).toBe('');
        await page.setInputFiles('#file', { name: 'chosen.glb', mimeType: '', buffer: GLB });
        await page.waitForFunction(() => document.getElementById('subtitle')!.textContent!.includes('chosen.glb'));
        await page.click('#tool-info');
        expect(await text(page, 'file-facts')).toContain('Splats36');
        quiet(opened, 'file://');
    });

    test('works as one file with its scene inside', async () => {
        const file = join(folder, 'scene.html');
        writeFileSync(file, exported(LTGS, HOSTILE));
        const opened = await driver.open(pathToFileURL(file).href);
        expect(await text(opened.page, 'title')).toBe(HOSTILE);
        const served = await driver.open((await driver.serve(LTGS)).url);
        expect(difference(await driver.canvas(opened.page), await driver.canvas(served.page)).largest).toBe(0);
        expect(opened.requests.filter((url) => !url.startsWith('blob:'))).toEqual([pathToFileURL(file).href]);
        expect(opened.errors).toEqual([]);

        writeFileSync(file, exported(LTGS, '').replace(/(;base64" id="litetex-asset">)..../, '$1!!!!'));
        const damaged = await driver.open(pathToFileURL(file).href, { wait: false });
        await says(damaged.page, 'The scene in this page is damaged.');
    });

    test('says so where nothing runs: in a file that is cut off, or without scripts', async () => {
        const file = join(folder, 'part.html'), { href } = pathToFileURL(file);
        const whole = exported(LTGS, 'whole');
        const unstarted = (page: Page) => page.evaluate(() => {
            const style = getComputedStyle(document.body, '::before');
            return style.content !== 'none' && style.visibility === 'visible' && parseFloat(style.height) > 0 ? style.content : '';
        });
        const scene = whole.indexOf('id="litetex-asset">'), script = whole.indexOf('<script type="module">');
        for (const end of [scene + 1000, whole.indexOf('</script>', scene), script, script + 1000]) {
            writeFileSync(file, whole.slice(0, end));
            const { page } = await driver.open(href, { wait: false });
            // Animations of a busy machine come late.
            await expect.poll(() => unstarted(page), { timeout: 15_000 }).toContain('This page is incomplete');
            expect(await page.locator('body > *:visible').count()).toBe(0);
        }
        writeFileSync(file, whole);
        const without = await driver.open(href, { wait: false, javaScriptEnabled: false });
        await expect.poll(() => unstarted(without.page), { timeout: 15_000 }).toContain('scripts are off');
        const { page, errors } = await driver.open(href);
        await page.waitForTimeout(1000);
        expect(await unstarted(page)).toBe('');
        expect(errors).toEqual([]);
    });

    test('takes files where there is neither a scene nor a program', async () => {
        const server = await driver.serve(LTGS);
        const { page } = await driver.open(server.origin, { wait: false });
        await page.waitForSelector('#welcome:not([hidden])');
        expect(await text(page, 'messages')).toBe('');
        const [chooser] = await Promise.all([page.waitForEvent('filechooser'), page.click('#welcome-open')]);
        await chooser.setFiles({ name: 'scene.ltgs', mimeType: '', buffer: LTGS });
        await driver.drawn(page);

        // A program started without a file serves the page all the same; what is dropped then is not replaced by what it says.
        const empty = await driver.serve(LTGS, (s) => { s.session.asset = null; });
        const served = await driver.open(empty.url, { wait: false });
        await served.page.waitForSelector('#welcome:not([hidden])');
        await drop(served.page, 'mine.glb', GLB);
        await driver.drawn(served.page);
        await served.page.waitForTimeout(3500);
        expect(await hidden(served.page, 'welcome')).toBe(true);
        expect(await text(served.page, 'subtitle')).toContain('mine.glb');
        quiet(served, empty.origin);
    });

    test('says that its address is wrong, and asks no more', async () => {
        const server = await driver.serve(LTGS);
        const { page, requests } = await driver.open(`${server.origin}/#deadbeef`, { wait: false });
        await says(page, 'This address is not, or no longer, valid: open the one that the program prints.');
        expect(await hidden(page, 'waiting')).toBe(true);
        await page.waitForTimeout(2500);
        expect(requests.filter((url) => url.endsWith('session.json'))).toHaveLength(1);
        expect(await text(page, 'messages')).not.toContain('has ended');
        await page.goto(server.url);
        await driver.drawn(page);
        expect(await text(page, 'messages')).toBe('');
    });

    test('shows a training: its state, new scenes with the camera kept, its end, and that of the program', async () => {
        const training = { step: 500, steps: 2000, etaSecs: 75, splats: 36, texels: 5628, curve: [[0, 12], [250, 20.5], [500, 24.25]], curveOf: 'psnr', state: 'running', revision: 1 };
        const server = await driver.serve(GLB, (s) => { s.session = { ...s.session, asset: null, training, title: 'my training' }; });
        const { page, errors, requests } = await driver.open(server.url, { wait: false, init: countDraws });
        await page.waitForFunction(() => document.getElementById('waiting')!.textContent!.includes('first scene'));
        expect(await text(page, 'training-step')).toBe('500 / 2,000');
        expect(await text(page, 'training-facts')).toBe('Time left1 min 15 sSplats36Texels5,628');
        expect(await page.getAttribute('#training-curve polyline', 'points')).toBe('0.0,64.0 120.0,19.6 240.0,0.0');
        const asset = { url: server.assetUrl, bytes: GLB.length, format: 'glb', name: 'preview', revision: 1 };
        server.session.asset = asset;
        await driver.drawn(page);
        await drag(page, 60, 20);
        const first = await driver.canvas(page);

        // Before another background: the same camera, another scene.
        server.asset = renamed(GLB, (key, value) => (key === 'background' ? [0.5, 0.1, 0.1] : value));
        server.session = { ...server.session, asset: { ...asset, revision: 2, bytes: server.asset.length }, training: { ...training, step: 1000 } };
        await page.waitForFunction(() => document.getElementById('training-step')!.textContent === '1,000 / 2,000');
        let second = await driver.canvas(page);
        for (let tries = 0; tries < 20 && difference(second, first).mean < 2; tries++) {
            await page.waitForTimeout(200);
            second = await driver.canvas(page);
        }
        expect(difference(second, first).mean).toBeGreaterThan(2);
        expect(second.name).toBe(first.name);
        server.asset = GLB;
        server.session = { ...server.session, asset: { ...asset, revision: 3 } };
        for (let tries = 0; tries < 20 && difference(second, first).largest > 0; tries++) {
            await page.waitForTimeout(200);
            second = await driver.canvas(page);
        }
        expect(difference(second, first).largest).toBe(0);
        const shown = await draws(page);
        expect(shown).toContain(1);
        expect(shown.slice(shown.indexOf(1)).every((batches) => batches === 1), 'an empty image between two scenes').toBe(true);

        server.asset = Buffer.from('in the middle of being written');
        server.session = { ...server.session, asset: { ...asset, revision: 4 }, training: { ...training, step: 1500, state: 'stopped' } };
        await says(page, 'The training has stopped at step 1500 of 2000.');
        await says(page, 'preview: ');
        expect(difference(await driver.canvas(page), first).largest).toBe(0);
        expect(errors).toEqual([]);

        await server.stop();
        await says(page, 'The program has ended.');
        expect(difference(await driver.canvas(page), first).largest).toBe(0);
        await server.start();
        await page.waitForFunction(() => !document.getElementById('messages')!.textContent!.includes('has ended'));
        expect(requests.every((url) => url.startsWith(server.origin) || url.startsWith('blob:') || url.startsWith('data:'))).toBe(true);
    });

    test('shows texts of files as text', async () => {
        const file = renamed(GLB, (key, value) => (key === 'name' && value === 'side' ? HOSTILE
            : key === 'provenance' ? { ...value as object, title: HOSTILE, author: HOSTILE, up: HOSTILE, training: { policy: HOSTILE } } : value));
        const server = await driver.serve(file, (s) => { s.session.asset!.name = HOSTILE; });
        const opened = await driver.open(server.url);
        const { page } = opened;
        expect(await text(page, 'title')).toBe(HOSTILE);
        expect(await page.title()).toBe(`${HOSTILE} – litetex`);
        await page.keyboard.press('n');
        await cameraIs(page, HOSTILE);
        await page.click('#tool-cameras');
        expect(await text(page, 'cameras')).toContain(HOSTILE);
        await page.click('#tool-info');
        expect(await text(page, 'provenance')).toContain(`Author${HOSTILE}`);
        expect(await text(page, 'provenance')).toContain(`Up${HOSTILE}`);
        expect(await text(page, 'training-settings')).toContain(HOSTILE);
        expect(await page.locator('img[src=x], #title b, #cameras b').count()).toBe(0);
        expect((await driver.canvas(page)).name).toMatch(/^[\w.-]+\.png$/);
        quiet(opened, server.origin);
    });

    test('is usable with the keyboard alone', async () => {
        const { page } = await driver.open((await driver.serve(LTGS)).url);
        await page.keyboard.press('?');
        expect(await page.locator('#help').isVisible()).toBe(true);
        expect(await text(page, 'help-keys')).toContain('save the image');
        await page.keyboard.press('Escape');
        expect(await page.locator('#help').isVisible()).toBe(false);
        await page.keyboard.press('l');
        expect(await page.getAttribute('#tool-cameras', 'aria-expanded')).toBe('true');
        await page.keyboard.press('i');
        expect(await text(page, 'panel-title')).toBe('Information');
        await page.keyboard.press('Escape');
        expect(await hidden(page, 'panel')).toBe(true);
        expect(await page.evaluate(() => document.activeElement!.id)).toBe('tool-info');
        const names = await page.evaluate(() => [...document.querySelectorAll('button, input:not([hidden]), [role=slider], canvas')]
            .filter((e) => !(e.getAttribute('aria-label') || e.textContent!.trim() || (e as HTMLInputElement).labels?.[0]?.textContent!.trim())).map((e) => e.outerHTML));
        expect(names).toEqual([]);
        for (let i = 0; i < 3; i++) await page.keyboard.press('Tab');
        expect(await page.evaluate(() => getComputedStyle(document.activeElement!).outlineStyle)).toBe('solid');
    });

    test('a double click turns to the surface there; two slow clicks do not, nor does one on the background', async () => {
        const { page } = renderer;
        const [{ at, point }] = await surfaces(renderer, 800, 600);
        await page.evaluate(async (url) => {
            const load = eval('(path) => import(path)'); // vitest would rewrite an import that it sees
            const { Viewer } = await load('/src/viewer/viewer.ts');
            const canvas = Object.assign(document.createElement('canvas'), { style: 'position: fixed; inset: 0; width: 800px; height: 600px' });
            document.body.append(canvas);
            const viewer = await new Promise<any>((resolve) => {
                const made = new Viewer(canvas, { load: () => resolve(made) }, canvas);
                made.open({ url });
            });
            Object.assign(window, { viewer });
        }, `/@fs/${join(PACK, 'balanced.ltgs')}`);
        const pose = () => page.evaluate(() => {
            const { target, centre, distance, forward } = (window as unknown as { viewer: any }).viewer.pose;
            return { target, centre, distance, forward };
        });
        const before = await pose();
        const settled = async () => {
            await page.waitForTimeout(600);
            await page.waitForFunction(() => !(window as unknown as { viewer: any }).viewer.turning);
            return pose();
        };
        await page.mouse.click(...at);
        await page.waitForTimeout(600);
        await page.mouse.click(...at);
        expect(await settled()).toEqual(before);
        await page.mouse.dblclick(2, 2); // the background
        expect(await settled()).toEqual(before);
        await page.mouse.dblclick(...at);
        const after = await settled();
        expect(after.centre).toEqual(before.centre);
        after.target.forEach((t: number, i: number) => expect(t).toBeCloseTo(point[i], 6));
        expect(Math.hypot(...before.target.map((t: number, i: number) => t - point[i]))).toBeGreaterThan(0.1);
        await page.evaluate(() => {
            const { viewer } = window as unknown as { viewer: any };
            viewer.dispose();
            viewer.canvas.remove();
        });
    });

    test('begins at the camera of its address, without controls, before a background of its own', async () => {
        const server = await driver.serve(LTGS);
        const address = new URL(server.url);
        address.search = 'camera=side&controls=off&background=%23ff0000&precision=exact';
        const { page } = await driver.open(address.href, { wait: false });
        await page.waitForFunction(() => document.getElementById('camera-name')!.textContent === 'side' && document.getElementById('progress')!.hidden);
        expect(await page.isVisible('#tools')).toBe(false);
        const before = await driver.window(page);
        await drag(page, 80, 30);
        await page.waitForTimeout(500);
        expect(difference(await driver.window(page), before).largest).toBe(0);
        const isRed = (at: number) => before.data[at] === 255 && before.data[at + 1] === 0 && before.data[at + 2] === 0;
        const reds = Array.from({ length: before.data.length / 4 }, (_, i) => isRed(4 * i)).filter(Boolean).length;
        expect(reds).toBeGreaterThan(1000);
    });

    test('measures between two clicks, and says where there is no surface', async () => {
        const server = await driver.serve(LTGS);
        const opened = await driver.open(server.url);
        const { page } = opened;
        const says = (words: string) => page.waitForFunction((wanted) => document.getElementById('measure-text')!.textContent!.includes(wanted), words);
        const option = () => text(page, 'measure-command');
        const pressed = () => page.getAttribute('#tool-measure', 'aria-expanded');
        await page.keyboard.press('m');
        expect(await pressed()).toBe('true');
        await says('Click on the first point.');
        expect(await page.getAttribute('#measure-text', 'role')).toBe('status');
        // Negative control: a corner shows the background only.
        await page.mouse.click(20, 590);
        await says('There is no surface there, only background. Click on the first point.');
        // A drag is no click.
        await drag(page, 60, 20);
        await page.keyboard.press('b');
        await says('Click on the first point.');
        const [first, second] = await surfaces(renderer, 800, 600);
        await page.mouse.click(...first.at);
        await says('Click on the second point.');
        expect(await page.locator('#measure-marks circle').count()).toBe(1);
        await page.mouse.click(...second.at);
        await says('units, unknown scale');
        expect(await page.locator('#measure-marks circle').count()).toBe(2);
        const apart = Math.hypot(...first.point.map((v, i) => v - second.point[i]));
        // The scene's file is scaled by 2.5.
        expect(Number.parseFloat(await text(page, 'measure-text') ?? '')).toBeCloseTo(2.5 * apart, 2);
        expect(await option()).toMatch(/^--scale-from '[-\d.]+,[-\d.]+,[-\d.]+ [-\d.]+,[-\d.]+,[-\d.]+ = \.\.\.m'$/);
        // Letters in the field are no shortcuts.
        await page.fill('#measure-length', '');
        await page.focus('#measure-length');
        await page.keyboard.type('30 mm');
        expect(await option()).toMatch(/ = 30mm'$/);
        expect(await pressed()).toBe('true');
        await page.context().grantPermissions(['clipboard-read', 'clipboard-write']);
        await page.click('#measure-copy');
        await page.waitForFunction(() => document.getElementById('measure-copied')!.textContent === 'Copied');
        expect(await page.evaluate(() => navigator.clipboard.readText())).toBe(await option());
        // Marks stay on their points while the camera moves.
        const place = () => page.locator('#measure-marks circle').first().getAttribute('cx');
        const before = await place();
        await page.keyboard.press('n');
        await expect.poll(place).not.toBe(before);
        await page.keyboard.press('p');
        await expect.poll(async () => Number(await place())).toBeCloseTo(Number(before), 3);
        await page.keyboard.press('Escape');
        expect(await pressed()).toBe('false');
        expect(await page.locator('#measure-marks').isVisible()).toBe(false);
        expect(await page.evaluate(() => document.activeElement!.id)).toBe('tool-measure');
        // With the keyboard alone: the middle of the window. Closed, clicks do nothing.
        await page.mouse.click(...first.at);
        await page.keyboard.press('m');
        await says('Click on the first point.');
        await page.focus('#measure-middle');
        await page.keyboard.press('Enter');
        await page.waitForFunction(() => /second point|no surface/.test(document.getElementById('measure-text')!.textContent!));
        quiet(opened, server.origin);
    });

    test.skipIf(!process.env.LITETEX)('what it measures makes the scale of an export', async () => {
        const [first, second] = await surfaces(renderer, 800, 600);
        const measured = async (file: Buffer) => {
            const { page } = await driver.open((await driver.serve(file)).url);
            await page.keyboard.press('m');
            await page.mouse.click(...first.at);
            await page.waitForFunction(() => document.getElementById('measure-text')!.textContent!.includes('second'));
            await page.mouse.click(...second.at);
            await page.locator('#measure-option').waitFor();
            await page.fill('#measure-length', '7');
            const option = await text(page, 'measure-command');
            const distance = await text(page, 'measure-text');
            await page.keyboard.press('Escape');
            await page.keyboard.press('i');
            return { option: option!, distance: distance!, facts: await text(page, 'provenance') };
        };
        const before = await measured(LTGS);
        expect(before.distance).toMatch(/units, unknown scale$/);
        expect(before.distance).not.toMatch(/^7 /);
        const scaled = join(folder, 'scaled.ltgs');
        const [, points] = /^--scale-from '(.*)'$/.exec(before.option)!;
        execFileSync(process.env.LITETEX!, ['-q', 'export', join(PACK, 'balanced.ltgs'), '-o', scaled, '--scale-from', points, '--quality', 'lossless', '--device', 'cpu']);
        const after = await measured(readFileSync(scaled));
        expect(after.distance).toBe('7 m');
        expect(after.facts).toContain('Scalemetres: 7 m between two points');
        // Places in the capture stay what they are.
        expect(after.option).toBe(before.option);
    });

    test.each([[360, 640], [844, 390]])('fits a phone of %i x %i', async (width, height) => {
        const server = await driver.serve(LTGS, (s) => {
            s.session.title = 'a-title-without-any-spaces-'.repeat(9);
            s.session.training = { step: 1, steps: 2, etaSecs: null, splats: 1, texels: 0, curve: [], state: 'running', revision: 1 };
        });
        const opened = await driver.open(server.url, { viewport: { width, height }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 });
        const { page } = opened;
        const fits = async (selector: string) => {
            for (const box of await page.locator(selector).all()) {
                if (!await box.isVisible()) continue;
                const { x, y, width: w, height: h } = (await box.boundingBox())!;
                expect(Math.min(x, y), selector).toBeGreaterThanOrEqual(0);
                expect([x + w <= width, y + h <= height], selector).toEqual([true, true]);
                expect(Math.min(w, h), selector).toBeGreaterThan(39.9);
            }
        };
        await fits('#tools button, #camera-bar button, #training summary');
        for (const tool of ['display', 'cameras', 'compare', 'measure', 'info']) {
            await page.tap(`#tool-${tool}`);
            await fits('#panel, #panel-close');
            for (const label of await page.locator('#panel label:visible, #panel button:visible').all()) expect((await label.boundingBox())!.height).toBeGreaterThan(39.9);
            expect(await page.evaluate(() => [document.documentElement.scrollWidth <= innerWidth, document.getElementById('panel')!.scrollWidth <= innerWidth])).toEqual([true, true]);
        }
        await page.tap('#panel-close');
        const before = await driver.canvas(page);
        expect(before.width).toBe(2 * width);
        const client = await page.context().newCDPSession(page);
        const touch = (type: 'touchStart' | 'touchMove' | 'touchEnd', ...points: [number, number][]) =>
            client.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
        await touch('touchStart', [180, 250]);
        await touch('touchMove', [220, 260]);
        await touch('touchEnd');
        const turned = await driver.canvas(page);
        expect(difference(turned, before).mean).toBeGreaterThan(1);
        await touch('touchStart', [150, 250], [210, 250]);
        await touch('touchMove', [130, 250], [230, 250]);
        await touch('touchEnd');
        expect(difference(await driver.canvas(page), turned).mean).toBeGreaterThan(1);
        quiet(opened, server.origin);
    });

    test.each([[640, 480], [360, 640], [641, 480]])("keeps the divider's handle off the panel in a window of %i x %i", async (width, height) => {
        const { page } = await driver.open((await driver.serve(LTGS)).url, { viewport: { width, height } });
        await page.click('#tool-compare');
        expect(await text(page, 'comparison-note')).toContain('served by litetex view');
        await page.click('label:has-text("scene without textures")');
        const grip = (await page.locator('.grip').boundingBox())!;
        await page.mouse.move(grip.x + 20, grip.y + 20);
        await page.mouse.down();
        await page.mouse.move(grip.x - 80, grip.y + 150, { steps: 4 });
        await page.mouse.up();
        expect((await page.locator('.grip').boundingBox())!.x).toBeCloseTo(grip.x - 100, 0);
        expect(await page.evaluate(() => String(getSelection()))).toBe('');
        const panel = (await page.locator('#panel').boundingBox())!;
        expect(grip.x + grip.width <= panel.x || grip.y + grip.height <= panel.y).toBe(true);
    });

    test('says so where nothing can be drawn', async () => {
        const server = await driver.serve(LTGS);
        const without = await driver.open(server.url, { wait: false, init: () => { HTMLCanvasElement.prototype.getContext = () => null; } });
        await says(without.page, 'no WebGL2');
        const { page } = await driver.open(server.url);
        await page.evaluate(() => document.querySelector('canvas')!.getContext('webgl2')!.getExtension('WEBGL_lose_context')!.loseContext());
        await says(page, 'The graphics driver has stopped.');
        await page.click('#messages button:has-text("Reload")');
        await driver.drawn(page);
        expect(await text(page, 'messages')).toBe('');
    });
});

function shiftedBy({ width, height, data }: Raster, px: number): Raster {
    const moved = Buffer.alloc(data.length);
    if (px > 0) data.copy(moved, 4 * px);
    else data.copy(moved, 0, -4 * px);
    return { width, height, data: moved };
}

interface Surface { at: [x: number, y: number]; point: number[] }

/** Two places of the home view, fitted into a viewport, that show surfaces far from each other, and what they show, in the data. */
async function surfaces(test: BrowserTest, width: number, height: number): Promise<[Surface, Surface]> {
    const found = await test.page.evaluate(async ([url, w, h]) => {
        const load = eval('(path) => import(path)'); // vitest would rewrite an import that it sees
        const [{ readFrom }, { homePose }, { pick }, { rayThrough, pointAt }] =
            await Promise.all(['core/worker/read-from', 'viewer/pose', 'core/pick', 'viewer/ray'].map((path): Promise<any> => load(`/src/${path}.ts`)));
        let info: any;
        const parts = new Map<number, any>();
        await readFrom({ url }, Infinity, (message: any) => {
            if (message.kind === 'info') info = message.info;
            if (message.kind === 'update') parts.set(message.update.first, message.update);
        });
        const view = homePose(info, { centre: [0, 0, 0], radius: 1 }).view(w, h);
        const all: { at: [number, number]; point: number[] }[] = [];
        for (let y = 100; y < h - 100; y += 10) {
            for (let x = 100; x < w / 2; x += 10) {
                const ray = rayThrough(view, [x, y], info.near);
                const hit = pick([...parts.values()], ray);
                if (hit) all.push({ at: [x, y], point: pointAt(ray, hit.distance) });
            }
        }
        return all;
    }, [`/@fs/${join(PACK, 'balanced.ltgs')}`, width, height] as const);
    const distance = (a: Surface) => Math.hypot(a.at[0] - found[0].at[0], a.at[1] - found[0].at[1]);
    return [found[0], found.reduce((a, b) => (distance(b) > distance(a) ? b : a))];
}

/** The renderer's own image of a camera, fitted into a viewport, as PNG. */
async function rendered(test: BrowserTest, file: string, name: string, width: number, height: number): Promise<Buffer> {
    const base64 = await test.page.evaluate(async ([url, camera, w, h]) => {
        const load = eval('(path) => import(path)'); // vitest would rewrite an import that it sees
        const [{ SplatRenderer }, { readFrom }, { fitted }] = await Promise.all(['core/render/renderer', 'core/worker/read-from', 'viewer/pose'].map((path): Promise<any> => load(`/src/${path}.ts`)));
        const canvas = Object.assign(document.createElement('canvas'), { width: w, height: h });
        const renderer = new SplatRenderer(canvas);
        await readFrom({ url }, Infinity, (message: { kind: string; info: object; update: object }) => {
            if (message.kind === 'info') renderer.start(message.info);
            if (message.kind === 'update') renderer.apply(message.update);
        });
        const found = renderer.info.cameras.find((candidate: { name: string }) => candidate.name === camera);
        const { scale, x, y } = fitted(found, w, h);
        const view = {
            rotation: found.rotation, translation: found.translation, focalPx: found.focalPx.map((f: number) => f * scale),
            principalPx: [x + found.principalPx[0] * scale, y + found.principalPx[1] * scale], widthPx: w, heightPx: h,
        };
        await renderer.sorted(view);
        renderer.draw(view);
        return canvas.toDataURL('image/png').split(',')[1];
    }, [`/@fs/${file}`, name, width, height] as const);
    return Buffer.from(base64, 'base64');
}
