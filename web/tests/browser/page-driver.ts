/** Opens the built page as a user would, and looks at what it shows. */

import { readFileSync } from 'node:fs';
import { chromium, type Browser, type BrowserContextOptions, type Page } from 'playwright-core';
import { expect } from 'vitest';
import { browserPath, FLAGS } from './browser';
import { PageServer } from './page-server';

export interface Raster {
    width: number;
    height: number;
    /** RGBA. */
    data: Buffer;
}

/** A page with everything that it logs and asks for. */
export interface Opened {
    page: Page;
    /** Errors of its console and of its scripts. */
    errors: string[];
    /** Addresses that it asked for. */
    requests: string[];
}

export class PageDriver {
    private readonly servers: PageServer[] = [];
    private constructor(private readonly browser: Browser, private readonly decoder: Page) {}

    static async start(): Promise<PageDriver> {
        const browser = await chromium.launch({ executablePath: browserPath()!, headless: true, args: FLAGS });
        return new PageDriver(browser, await browser.newPage());
    }

    async close(): Promise<void> {
        await this.browser.close();
        for (const server of this.servers) await server.stop();
    }

    /** A server that shows a file. */
    async serve(file: Buffer, change: (server: PageServer) => void = () => {}): Promise<PageServer> {
        const server = new PageServer();
        server.asset = file;
        server.session.asset!.bytes = file.length;
        change(server);
        await server.start();
        this.servers.push(server);
        return server;
    }

    /** Opens an address in a window, and waits until an image of the scene is drawn. */
    async open(url: string, { wait = true, init, ...options }: BrowserContextOptions & { wait?: boolean; init?: () => void } = {}): Promise<Opened> {
        const context = await this.browser.newContext({ viewport: { width: 800, height: 600 }, acceptDownloads: true, ...options });
        const page = await context.newPage();
        const opened: Opened = { page, errors: [], requests: [] };
        page.on('console', (message) => { if (message.type() === 'error' || message.type() === 'warning') opened.errors.push(message.text()); });
        page.on('pageerror', (error) => opened.errors.push(String(error)));
        page.on('request', (request) => opened.requests.push(request.url()));
        if (init) await page.addInitScript(init);
        // A training beside it may keep the processor busy.
        await page.goto(url, { timeout: 100_000 });
        if (wait) await this.drawn(page);
        return opened;
    }

    /** Waits until the scene is read and drawn. */
    async drawn(page: Page, splats = '36 splats'): Promise<void> {
        await page.waitForFunction((text) => {
            const shown = (id: string) => document.getElementById(id)!;
            return shown('figures').textContent!.includes(text) && shown('progress').hidden && shown('waiting').hidden;
        }, splats);
    }

    /** The canvas, by the page's own way to save it. */
    async canvas(page: Page): Promise<Raster & { name: string }> {
        const [download] = await Promise.all([page.waitForEvent('download'), page.keyboard.press('x')]);
        return { ...await this.decode(readFileSync(await download.path())), name: download.suggestedFilename() };
    }

    /** What the window shows of a camera at rest, without tools and texts. */
    async window(page: Page): Promise<Raster> {
        await page.waitForTimeout(250);
        await this.canvas(page); // which waits for the order of the splats
        const bare = (on: boolean) => page.evaluate((hidden) => {
            for (const id of ['corner', 'tools', 'panel', 'bottom', 'messages', 'slider']) document.getElementById(id)!.style.visibility = hidden ? 'hidden' : '';
        }, on);
        await bare(true);
        const raster = await this.decode(await page.screenshot({ animations: 'disabled' }));
        await bare(false);
        return raster;
    }

    async decode(png: Buffer): Promise<Raster> {
        const { width, height, data } = await this.decoder.evaluate(async (base64) => {
            const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
            const bitmap = await createImageBitmap(new Blob([bytes], { type: 'image/png' }), { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
            const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
            context.drawImage(bitmap, 0, 0);
            const rgba = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
            let text = '';
            for (let i = 0; i < rgba.length; i += 0x8000) text += String.fromCharCode(...rgba.subarray(i, i + 0x8000));
            return { width: bitmap.width, height: bitmap.height, data: btoa(text) };
        }, png.toString('base64'));
        return { width, height, data: Buffer.from(data, 'base64') };
    }
}

/** Largest and mean difference of two images, in 255ths, in a part of them: columns and rows from, to. */
export function difference(a: Raster, b: Raster, [x0, x1] = [0, a.width], [y0, y1] = [0, a.height]): { largest: number; mean: number } {
    if (a.width !== b.width || a.height !== b.height) throw new Error(`images of ${a.width} x ${a.height} and ${b.width} x ${b.height}`);
    let largest = 0, sum = 0;
    for (let y = y0; y < y1; y++) {
        for (let i = 4 * (y * a.width + x0); i < 4 * (y * a.width + x1); i++) {
            const d = Math.abs(a.data[i] - b.data[i]);
            largest = Math.max(largest, d);
            sum += d;
        }
    }
    return { largest, mean: sum / (4 * (x1 - x0) * (y1 - y0)) };
}

/** The same `.glb` file with other texts in its JSON. */
export function renamed(glb: Buffer, change: (key: string, value: unknown) => unknown): Buffer {
    const length = glb.readUInt32LE(12);
    const json = Buffer.from(JSON.stringify(JSON.parse(glb.toString('utf8', 20, 20 + length)), change));
    const padded = Buffer.concat([json, Buffer.alloc(-json.length & 3, ' ')]);
    const head = Buffer.alloc(20);
    glb.copy(head, 0, 0, 20);
    head.writeUInt32LE(padded.length, 12);
    const file = Buffer.concat([head, padded, glb.subarray(20 + length)]);
    file.writeUInt32LE(file.length, 8);
    return file;
}

export const text = (page: Page, id: string) => page.evaluate((which) => document.getElementById(which)!.textContent, id);
export const says = (page: Page, words: string) => page.waitForFunction((wanted) => document.getElementById('messages')!.textContent!.includes(wanted), words);

/** Nothing went wrong, and nothing was asked of anyone but the page's own server. */
export function quiet({ errors, requests }: Opened, origin: string): void {
    expect(errors).toEqual([]);
    expect(requests.filter((url) => !url.startsWith(`${origin}/`) && !/^(blob|data):/.test(url))).toEqual([]);
}
