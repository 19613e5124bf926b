/** What browsers and people do to the built page while it shows a scene. */

import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import type { Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { browserPath, WEB } from './browser';
import { type LossWindow, setUpLoss } from './context';
import { difference, PageDriver, says, text } from './page-driver';
import { exported } from './page-server';

const LTGS = readFileSync(join(WEB, '../samples/conformance/balanced.ltgs'));
const GLB = readFileSync(join(WEB, '../samples/conformance/balanced.glb'));

describe.skipIf(!browserPath())('page', () => {
    let driver: PageDriver;
    const folder = mkdtempSync(join(tmpdir(), 'page-life-'));
    beforeAll(async () => { driver = await PageDriver.start(); });
    afterAll(async () => {
        await driver?.close();
        rmSync(folder, { recursive: true });
    });

    const on = (page: Page, what: 'lose' | 'restore') => page.evaluate((name) => (window as unknown as LossWindow)[name](document.querySelector('canvas')!), what);
    const cameraIs = (page: Page, name: string) => page.waitForFunction((wanted) => document.getElementById('camera-name')!.textContent === wanted, name, { timeout: 5000 });

    /** Takes the context away and gives it back. The image must be the same then, and must be gone before. */
    async function survives(page: Page): Promise<void> {
        await page.waitForTimeout(300);
        const before = await driver.canvas(page);
        expect(difference(before, { ...before, data: Buffer.alloc(before.data.length, before.data.subarray(0, 4)) }).mean).toBeGreaterThan(2);
        await on(page, 'lose');
        await says(page, 'The graphics driver has stopped.');
        await page.keyboard.press('x');
        await says(page, 'The image cannot be saved');
        await page.click('#messages button:has-text("Close")');
        await on(page, 'restore');
        await page.waitForFunction(() => document.getElementById('messages')!.textContent === '', null, { timeout: 5000 });
        await expect.poll(async () => difference(await driver.canvas(page), before).largest, { timeout: 10_000 }).toBe(0);
    }

    test('comes back after the loss of its context, as often as that happens, and asks nobody for the file', async () => {
        const server = await driver.serve(LTGS);
        const { page, requests, errors } = await driver.open(server.url, { init: setUpLoss });
        await page.click('#tool-cameras');
        await page.click('#cameras button:has-text("side")');
        await page.keyboard.press('2');
        await survives(page);
        await survives(page);
        expect(await page.isChecked('input[value=untextured]')).toBe(true);
        expect(await text(page, 'camera-name')).toBe('side');
        expect(requests.filter((url) => url.endsWith(server.assetUrl!))).toHaveLength(1);
        expect(errors.filter((error) => !/CONTEXT_LOST_WEBGL|context lost/i.test(error))).toEqual([]);
        // New scenes of a training still come.
        server.session.asset!.revision++;
        server.asset = GLB;
        await expect.poll(() => requests.filter((url) => url.endsWith(server.assetUrl!)).length, { timeout: 10_000 }).toBe(2);
        await survives(page);
    });

    test('comes back with a scene inside, with one that was dropped, and in the middle of reading', async () => {
        const file = join(folder, 'scene.html');
        writeFileSync(file, exported(LTGS, 'inside'));
        const { page } = await driver.open(pathToFileURL(file).href, { init: setUpLoss });
        await survives(page);
        await page.setInputFiles('#file', { name: 'chosen.glb', mimeType: '', buffer: GLB });
        await page.waitForFunction(() => document.getElementById('subtitle')!.textContent!.includes('chosen.glb'));
        await survives(page);
        // A file that cannot be read leaves the other, which comes back.
        await page.setInputFiles('#file', { name: 'cut.ltgs', mimeType: '', buffer: LTGS.subarray(0, 9000) });
        await says(page, 'cut.ltgs: ');
        await page.keyboard.press('Escape');
        await survives(page);
        // Lost before the file has been read.
        const early = await driver.open((await driver.serve(LTGS)).url, { init: setUpLoss });
        const expected = await driver.canvas(early.page);
        await on(early.page, 'lose');
        await early.page.setInputFiles('#file', { name: 'late.ltgs', mimeType: '', buffer: LTGS });
        await early.page.waitForTimeout(300);
        await on(early.page, 'restore');
        await early.page.waitForFunction(() => document.getElementById('subtitle')!.textContent!.includes('late.ltgs'));
        await expect.poll(async () => difference(await driver.canvas(early.page), expected).largest, { timeout: 10_000 }).toBe(0);
    });

    test('letters move the camera wherever the focus is, but not where someone types; arrows stay where they are needed', async () => {
        const { page } = await driver.open((await driver.serve(LTGS)).url);
        /** Holds a key where the focus is. Returns whether the camera moves, which then goes back. */
        const moves = async (key: string, waitMs = 3000) => {
            await cameraIs(page, 'wide');
            await page.keyboard.down(key);
            const moved = await page.waitForFunction(() => document.getElementById('camera-name')!.textContent !== 'wide', null, { timeout: waitMs }).then(() => true, () => false);
            await page.keyboard.up(key);
            await page.evaluate(() => document.getElementById('camera-name')!.click());
            return moved;
        };
        const moveNot = async (...keys: string[]) => {
            for (const key of keys) expect([key, await moves(key, 300)]).toEqual([key, false]);
        };
        await page.click('#tool-compare');
        await page.keyboard.press('f');
        for (const focus of ['#canvas', '#tool-save', '#comparison input']) {
            await page.evaluate((selector) => document.querySelector<HTMLElement>(selector)!.focus(), focus);
            for (const key of ['w', 'a', 's', 'd', 'q', 'e']) expect([focus, key, await moves(key)]).toEqual([focus, key, true]);
            if (focus === '#canvas') expect(await moves('ArrowLeft')).toBe(true);
            else await moveNot('ArrowLeft');
        }
        // A tap moves, however short.
        await page.evaluate(() => {
            for (const type of ['keydown', 'keyup']) document.body.dispatchEvent(new KeyboardEvent(type, { code: 'KeyW', key: 'w', bubbles: true }));
        });
        await page.waitForFunction(() => document.getElementById('camera-name')!.textContent !== 'wide', null, { timeout: 5000 });
        await page.evaluate(() => document.getElementById('camera-name')!.click());
        await page.evaluate(() => (document.activeElement as HTMLElement).blur());
        expect([await moves('w'), await moves('ArrowLeft')]).toEqual([true, true]);
        for (const html of ['<input id="field">', '<input id="field" type="search">', '<textarea id="field"></textarea>', '<select id="field"></select>', '<div id="field" contenteditable></div>']) {
            await page.evaluate((markup) => {
                document.getElementById('field')?.remove();
                document.body.append(document.createRange().createContextualFragment(markup));
                document.getElementById('field')!.focus();
            }, html);
            await moveNot('w', 'ArrowLeft');
        }
        await page.evaluate(() => document.getElementById('field')!.remove());
        await page.keyboard.press('?');
        await moveNot('w');
        await page.keyboard.press('Escape');
        // A key that is released with another held, or in another window, is not pressed for ever.
        await page.keyboard.down('w');
        await page.keyboard.down('Control');
        await page.keyboard.up('w');
        await page.keyboard.up('Control');
        await page.evaluate(() => document.getElementById('camera-name')!.click());
        await page.waitForTimeout(200);
        expect(await text(page, 'camera-name')).toBe('wide');
    });
});
