/** The examples, built with the package as it is published, checked, and opened in Chromium. */

import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync } from 'node:fs';
import { createServer, type Server } from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { chromium, type Browser, type Page } from 'playwright-core';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { compileScript, parse } from 'vue/compiler-sfc';
import { build, type InlineConfig } from 'vite';
import { browserPath, FLAGS } from '../browser/browser';
import { setUpLoss, type LossWindow } from '../browser/context';

const WEB = join(import.meta.dirname, '../..');
const EXAMPLES = join(WEB, 'examples');
const SCENES = join(WEB, '../samples/conformance');
/** Those with an `index.html` that a bundler builds. */
const BUILT = ['react', 'preact', 'vue', 'react-fiber'];
const out = mkdtempSync(join(tmpdir(), 'examples-'));
const next = { ssr: join(out, 'server/next.server.js'), script: '/built/next/next.js' };

beforeAll(async () => {
    execFileSync('npm', ['run', '--silent', 'build'], { cwd: WEB, stdio: 'pipe' });
    const into = (name: string, options: InlineConfig['build'], more: InlineConfig = {}) =>
        build({ base: './', logLevel: 'error', ...more, build: { outDir: join(out, name), emptyOutDir: true, chunkSizeWarningLimit: 2000, ...options } });
    for (const name of BUILT) await into(name, {}, { root: join(EXAMPLES, name) });
    const root = { root: import.meta.dirname, configFile: false } as const;
    await into('next', { rolldownOptions: { input: join(root.root, 'next.client.tsx'), output: { entryFileNames: 'next.js' } } }, root);
    await into('server', { ssr: join(root.root, 'next.server.tsx') }, { ...root, ssr: { noExternal: true } });
}, 120_000);
afterAll(() => rmSync(out, { recursive: true }));

/** Errors that the compiler finds in a project. */
function errorsOf(project: string): string {
    try {
        execFileSync(join(WEB, 'node_modules/.bin/tsc'), ['-p', project], { cwd: WEB, stdio: 'pipe' });
        return '';
    } catch (error) {
        return String((error as { stdout?: Buffer }).stdout ?? error);
    }
}

describe('types', () => {
    test.each(['react-19', 'react-18', 'preact', 'vue', 'next'])('of attributes, events and references: %s', (name) => expect(errorsOf(join(import.meta.dirname, `types/${name}.json`))).toBe(''));
    test.each(['react', 'preact', 'react-fiber', 'next'])('of the example: %s', (name) => expect(errorsOf(join(EXAMPLES, name))).toBe(''));

    test('of the script of the example for Vue', () => {
        const folder = mkdtempSync(join(WEB, 'node_modules/.vue-'));
        try {
            const source = readFileSync(join(EXAMPLES, 'vue/App.vue'), 'utf8');
            const check = (text: string) => {
                const { descriptor, errors } = parse(text);
                expect(errors).toEqual([]);
                const { content } = compileScript(descriptor, { id: 'app', inlineTemplate: false });
                writeFileSync(join(folder, 'App.vue.ts'), content);
                return errorsOf(folder);
            };
            writeFileSync(join(folder, 'main.ts'), readFileSync(join(EXAMPLES, 'vue/main.ts')));
            writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify({ extends: join(EXAMPLES, 'vue/tsconfig.json'), include: [], files: ['main.ts'] }));
            expect(check(source)).toBe('');
            expect(check(source.replace('ref<string[]>([])', 'ref<string[]>([1])'))).toMatch(/TS2322/);
        } finally {
            rmSync(folder, { recursive: true });
        }
    });
});

test('the code of the README stands in the examples', () => {
    const section = /\n## In React, Preact, Vue\n([\s\S]*?)\n## /.exec(readFileSync(join(WEB, 'README.md'), 'utf8'))![1];
    const plain = (text: string) => text.replace(/\s+/g, ' ').trim();
    const sources = readdirSync(EXAMPLES, { recursive: true, encoding: 'utf8' }).filter((path) => /\.(tsx?|vue)$/.test(path)).map((path) => plain(readFileSync(join(EXAMPLES, path), 'utf8')));
    const blocks = [...section.matchAll(/```\w+\n([\s\S]*?)```/g)].map(([, code]) => plain(code));
    expect(blocks.length).toBeGreaterThan(2);
    expect(blocks.filter((block) => !sources.some((source) => source.includes(block)))).toEqual([]);
});

/** The document that a server sends. */
const served = async () => (await import(pathToFileURL(next.ssr).href) as { html(script: string): Promise<string> }).html(next.script);

test('a server renders the element, which it does not run', async () => {
    expect(await served()).toContain('<litetex-viewer src="/scene.ltgs" alt="A still life" camera-controls="" style="height:70vh"></litetex-viewer><p>loading</p>');
});

describe.skipIf(!browserPath())('in Chromium', () => {
    let server: Server;
    let browser: Browser;

    const TYPES: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.css': 'text/css' };
    function fileOf(path: string): string | null {
        if (/\/scene\.\w+$/.test(path)) return join(SCENES, `balanced${extname(path)}`);
        const file = path.startsWith('/built/') ? join(out, path.slice(7), path.endsWith('/') ? 'index.html' : '') : join(WEB, path);
        return existsSync(file) && statSync(file).isFile() ? file : null;
    }

    beforeAll(async () => {
        server = createServer(async ({ url }, response) => {
            const path = new URL(url!, 'http://a').pathname;
            const file = fileOf(path);
            const body = path === '/next' ? await served() : file && readFileSync(file);
            response.writeHead(body ? 200 : 404, { 'content-type': path.startsWith('/next') || path.endsWith('/') ? 'text/html' : TYPES[extname(path)] ?? 'application/octet-stream' }).end(body);
        });
        await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
        browser = await chromium.launch({ executablePath: browserPath()!, headless: true, args: FLAGS });
    });
    afterAll(async () => {
        await browser?.close();
        server?.close();
    });

    /** Opens a page, does something there, and expects that its console shows no errors. */
    async function open(path: string, use: (page: Page) => Promise<void>): Promise<void> {
        const page = await browser.newPage({ viewport: { width: 300, height: 260 } });
        const errors: string[] = [];
        page.on('console', (message) => { if (message.type() === 'error' && !message.location().url.endsWith('/favicon.ico')) errors.push(message.text()); });
        page.on('pageerror', (error) => errors.push(String(error)));
        try {
            await page.addInitScript(setUpLoss);
            await page.goto(`http://127.0.0.1:${(server.address() as AddressInfo).port}${path}`);
            await use(page).catch((error) => { throw new Error([String(error), ...errors].join('\n')); });
            expect(errors).toEqual([]);
        } finally {
            await page.close();
        }
    }

    /** Number of colours in the upper left of the page, without text. */
    async function colours(page: Page): Promise<number> {
        const shot = (await page.screenshot({ clip: { x: 0, y: 0, width: 200, height: 150 }, style: 'label, button, h1, p { visibility: hidden }' })).toString('base64');
        return page.evaluate(async (png) => {
            const bitmap = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
            const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d')!;
            context.drawImage(bitmap, 0, 0);
            return new Set(new Uint32Array(context.getImageData(0, 0, bitmap.width, bitmap.height).data.buffer)).size;
        }, shot);
    }
    const drawn = (page: Page) => expect.poll(() => colours(page), { timeout: 30_000 }).toBeGreaterThan(200);
    const contexts = (page: Page) => page.evaluate(() => (window as unknown as LossWindow).contexts());

    /** Attributes that go on and off, events and methods, in an example with the element. */
    async function useElement(page: Page): Promise<void> {
        await page.getByRole('button', { name: 'side', exact: true }).waitFor(); // made of what `load` tells
        await page.evaluate(() => {
            Object.assign(window, { moves: 0 });
            document.querySelector('litetex-viewer')!.addEventListener('camera-change', () => { (window as unknown as { moves: number }).moves++; });
        });
        const moves = () => page.evaluate(() => (window as unknown as { moves: number }).moves);
        const still = async () => {
            const before = await moves();
            await page.waitForTimeout(300);
            return (await moves()) === before;
        };
        expect(await still()).toBe(true);
        await page.getByLabel('turns').check();
        await expect.poll(still).toBe(false);
        await page.getByLabel('turns').uncheck();
        await expect.poll(still).toBe(true);
        const before = await moves();
        await page.getByRole('button', { name: 'side', exact: true }).click();
        await expect.poll(moves).toBeGreaterThan(before);
    }

    test.each(BUILT)('%s draws, and leaves nothing behind', (name) => open(`/built/${name}/`, async (page) => {
        await drawn(page);
        expect(await contexts(page)).toBe(1);
        if (name !== 'react-fiber') await useElement(page);
        await page.getByLabel('shown').uncheck();
        await expect.poll(() => contexts(page), { timeout: 10_000 }).toBe(0);
        expect(await page.locator('litetex-viewer, canvas').count()).toBe(0);
        expect(await colours(page)).toBeLessThan(5);
        if (name === 'react-fiber') await expect.poll(() => page.workers().length).toBe(0); // its example disposes of the splats
        await page.getByLabel('shown').check();
        await drawn(page);
    }));

    test('the document of a server is taken over', () => open('/next', async (page) => {
        await page.getByText('loaded').waitFor();
        await drawn(page);
    }));

    test.each(readdirSync(EXAMPLES).filter((name) => name.endsWith('.html')))('%s draws', (name) => open(`/examples/${name}`, drawn));
});
