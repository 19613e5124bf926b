/** Images of LitetexSplats in PlayCanvas against `litetex render` of the same file. */

import { execFileSync } from 'node:child_process';
import { createReadStream, existsSync, mkdtempSync } from 'node:fs';
import { createServer } from 'node:http';
import type { AddressInfo } from 'node:net';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { BrowserTest, browserPath, WEB } from './browser';
import type { How, Image, Scenarios, Shot } from './playcanvas-harness';
import { compare, type FloatImage, reference } from './reference';

const REPOSITORY = join(import.meta.dirname, '../../..');
const LITETEX = process.env.LITETEX ?? join(REPOSITORY, 'target/debug/litetex');
const PACK = join(REPOSITORY, 'samples/conformance');
const FILE = join(PACK, 'lossless.glb');

function rgbOf({ rgb }: Image): Float32Array {
    const bytes = Buffer.from(rgb, 'base64');
    return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
}

describe.skipIf(!browserPath())('PlayCanvas', () => {
    const sample = mkdtempSync(join(tmpdir(), 'litetex-playcanvas-'));
    let browser: BrowserTest;
    const references = new Map<string, FloatImage>();

    beforeAll(async () => {
        execFileSync(LITETEX, ['-q', 'sample', join(sample, 'capture'), '--views', '8', '--size', '160x120', '--points', '2000', '--no-truth']);
        execFileSync(LITETEX, ['-q', 'train', join(sample, 'capture'), '-o', join(sample, 'run'), '--device', 'cpu', '--steps', '60',
            '--set', 'density.start=10', '--set', 'density.interval=10', '--set', 'density.texture-start=15']);
        execFileSync(LITETEX, ['-q', 'export', join(sample, 'run'), '--no-verify', '-o', join(sample, 'sample.ltgs')]);
        browser = await BrowserTest.open('tests/browser/playcanvas.html', [REPOSITORY, sample]);
    });
    afterAll(() => browser?.close());

    const run = <Name extends keyof Scenarios>(name: Name, ...args: Parameters<Scenarios[Name]>) =>
        browser.page.evaluate(([which, given]) => {
            return (window as unknown as { scenarios: Record<string, (...args: unknown[]) => unknown> }).scenarios[which](...given);
        }, [name, args] as [string, unknown[]]) as Promise<Awaited<ReturnType<Scenarios[Name]>>>;
    const url = (file: string) => `/@fs/${file}`;
    const expected = (file: string, view: string) => {
        const key = `${file} ${view}`;
        if (!references.has(key)) references.set(key, reference(LITETEX, file, view));
        return references.get(key)!;
    };
    const shot = async (more: Partial<Shot> = {}, file = FILE): Promise<number> => {
        const view = more.view ?? 'wide';
        const image = await run('image', { url: url(file), view, ...more });
        const { psnr } = compare(rgbOf(image), expected(file, view).rgb);
        if (process.env.LITETEX_FIGURES) console.log(file, JSON.stringify(more), psnr.toFixed(1));
        return psnr;
    };

    test.each(['wide', 'side', 'inside'])('splats that decide every rule, %s', async (view) => {
        // Measured: 46.2 dB and more.
        for (const file of [FILE, join(PACK, 'balanced.ltgs')]) expect(await shot({ view }, file)).toBeGreaterThan(43);
    });
    test.each(['view_0002.png', 'view_0005.png'])('a trained scene, %s', async (view) => expect(await shot({ view }, join(sample, 'sample.ltgs'))).toBeGreaterThan(43));
    test('under a parent that is moved, turned and scaled the image is the same', async () => expect(await shot({ parent: true, view: 'inside' })).toBeGreaterThan(43));
    test('after the loss of the context', async () => expect(await shot({ restored: true })).toBeGreaterThan(43));

    test.each<How>(['antialiased', 'target', 'flipped', 'linear', 'linear-multisampled', 'frame', 'frame-depth'])('into %s, over a mesh behind all splats', async (how) => {
        // Measured: 42.1 dB with depth of field, which mixes images of half the size in, else 45.3 and more.
        expect(await shot({ how, mesh: { distance: 9e4 } })).toBeGreaterThan(how === 'frame-depth' ? 40 : 43);
    });
    test.each<How>(['canvas', 'linear', 'frame'])('an opaque mesh before the splats hides all of them: %s', async (how) => {
        const colour = [0.2, 0.4, 0.6];
        const image = rgbOf(await run('image', { url: url(FILE), view: 'wide', how, mesh: { colour, distance: 0.01 } }));
        expect(Math.max(...image.map((value, i) => Math.abs(value - colour[i % 3])))).toBeLessThan(0.006);
    });
    test.each([false, true])('a mesh cuts a splat along its plane; in a layer of their own: %s', async (layerOfItsOwn) => {
        const row = await run('cut', layerOfItsOwn);
        // The disc comes nearer than the mesh to the left of x = 0.1, which is seen 1.85 px from the middle.
        expect(row.slice(28, 34).every((red) => red > 0.5)).toBe(true);
        expect(row.slice(34).every((red) => red === 0)).toBe(true);
    });

    test.each(['reversed', 'mirrored'] as const)('control: %s fails', async (control) => expect(await shot({ control })).toBeLessThan(40));
    test('control: without textures it fails', async () => expect(await shot({ colours: 'untextured' })).toBeLessThan(40));

    test('two cameras of one frame are both right', async () => {
        const images = await run('pair', url(FILE), ['wide', 'inside']);
        for (const [i, view] of ['wide', 'inside'].entries()) expect(compare(rgbOf(images[i]), expected(FILE, view).rgb).psnr).toBeGreaterThan(43);
    });

    test('small turns are sorted in the worker, which asks for another image', async () => {
        const { before, after, exact } = await run('turned', url(FILE), 'wide');
        expect(before.rgb === exact.rgb).toBe(false);
        expect(after.rgb === exact.rgb).toBe(true);
    });

    test('meshes, textures and the interface of PlayCanvas are drawn as without splats', async () => {
        const [beside, without, colours] = await run('beside', url(FILE), 'wide');
        expect(colours).toBeGreaterThan(50); // the splats were there
        expect(new Set(without).size).toBeGreaterThan(10);
        expect(beside).toEqual(without);
    });

    test.each([
        ['srgb_rec709_display', 'canvas', 0.5], ['srgb_rec709_display', 'target', 0.5], ['srgb_rec709_display', 'linear', 0.5], ['lin_rec709_display', 'canvas', 0.73536],
        ['lin_rec709_display', 'target', 0.73536],
    ] as const)('colours of %s in a target: %s', async (space, how, value) => expect(Math.abs(await run('converted', space, how) - 0.99 * value)).toBeLessThan(0.008));

    test.each(['dispose', 'entity'] as const)('%s frees what was made', async (how) => {
        const { before, with: during, after, listeners } = await run('memory', url(FILE), 'wide', how);
        expect(during.Texture).toBeGreaterThan(before.Texture + 10);
        expect(after).toEqual(before);
        expect(listeners).toEqual([0, 1, 0]);
    });

    test('the example shows the package as it is built, one camera after the other', async () => {
        execFileSync('npm', ['run', '--silent', 'build'], { cwd: WEB, stdio: 'pipe' });
        const types: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript' };
        const server = createServer(({ url: path = '' }, response) => {
            const file = path.endsWith('/scene.ltgs') ? join(PACK, 'balanced.ltgs') : join(WEB, path);
            if (!existsSync(file)) return response.writeHead(path === '/favicon.ico' ? 204 : 404).end();
            response.writeHead(200, { 'Content-Type': types[extname(file)] ?? 'application/octet-stream' });
            return createReadStream(file).pipe(response);
        });
        await new Promise<void>((resolve) => server.listen(0, '127.0.0.1', resolve));
        const page = await browser.browser.newPage();
        const errors: string[] = [];
        page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
        page.on('pageerror', (error) => errors.push(String(error)));
        await page.goto(`http://127.0.0.1:${(server.address() as AddressInfo).port}/examples/playcanvas.html`);
        const canvas = page.locator('canvas');
        const psnr = async (view: string) => {
            const { width, height, rgb } = expected(join(PACK, 'balanced.ltgs'), view);
            const seen = await browser.page.evaluate(async (png) => {
                const image = await createImageBitmap(await (await fetch(`data:image/png;base64,${png}`)).blob());
                const context = new OffscreenCanvas(image.width, image.height).getContext('2d')!;
                context.drawImage(image, 0, 0);
                return { width: image.width, height: image.height, rgba: [...context.getImageData(0, 0, image.width, image.height).data] };
            }, (await canvas.screenshot()).toString('base64'));
            if (seen.width !== width || seen.height !== height) return 0; // not yet there
            return compare(Float32Array.from(seen.rgba.filter((_, i) => i % 4 < 3), (byte) => byte / 255), rgb).psnr;
        };
        await expect.poll(() => psnr('wide'), { timeout: 30_000 }).toBeGreaterThan(43);
        expect(await psnr('inside')).toBeLessThan(40);
        await canvas.click();
        await expect.poll(() => psnr('side'), { timeout: 30_000 }).toBeGreaterThan(43);
        expect(errors).toEqual([]);
        await page.close();
        server.close();
    });

    test('what is not supported is said once', async () => {
        expect(await run('warned', 'orthographic')).toEqual({ said: [expect.stringContaining('cameras without perspective')], red: 0 });
        expect(await run('warned', 'stretched')).toEqual({ said: [expect.stringContaining('uneven scales')], red: expect.closeTo(0.99, 1) });
    });
    test('files of other kinds are refused', async () => expect(await run('failure', url(join(PACK, 'wide.png')))).toMatch(/SceneError: .*image/));
    test('other devices are refused, with the remedy', async () => expect(await run('refused')).toContain("deviceTypes: ['webgl2']"));
    test('the page shows no errors', () => expect(browser.errors).toEqual([]));
});
