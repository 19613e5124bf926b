/** Images of LitetexSplats in three.js against `litetex render` of the same file. */

import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import type { WebGLRendererParameters } from 'three';
import { BrowserTest, browserPath } from './browser';
import { compare, reference, type FloatImage } from './reference';
import type { Image, Scenarios, Shot } from './three-harness';

const REPOSITORY = join(import.meta.dirname, '../../..');
const LITETEX = process.env.LITETEX ?? join(REPOSITORY, 'target/debug/litetex');
const PACK = join(REPOSITORY, 'samples/conformance');
const VIEWS = ['wide', 'side', 'inside'];

function rgbOf({ rgb }: Image): Float32Array {
    const bytes = Buffer.from(rgb, 'base64');
    return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
}

describe.skipIf(!browserPath())('three.js', () => {
    let browser: BrowserTest;
    const references = new Map<string, FloatImage>();

    beforeAll(async () => {
        browser = await BrowserTest.open('tests/browser/three.html', [REPOSITORY]);
    });
    afterAll(() => browser?.close());

    const run = <Name extends keyof Scenarios>(name: Name, ...args: Parameters<Scenarios[Name]>) =>
        browser.page.evaluate(([which, given]) => {
            return (window as unknown as { scenarios: Record<string, (...args: unknown[]) => unknown> }).scenarios[which](...given);
        }, [name, args] as [string, unknown[]]) as Promise<Awaited<ReturnType<Scenarios[Name]>>>;
    const url = (file: string) => `/@fs/${join(PACK, file)}`;
    const expected = (file: string, view: string) => {
        const key = `${file} ${view}`;
        if (!references.has(key)) references.set(key, reference(LITETEX, join(PACK, file), view));
        return references.get(key)!;
    };
    const shot = async (file: string, more: Partial<Shot> = {}): Promise<number> => {
        const view = more.view ?? 'wide';
        const image = await run('image', { url: url(file), view, how: 'half', ...more });
        const { psnr } = compare(rgbOf(image), expected(file, view).rgb);
        if (process.env.LITETEX_FIGURES) console.log(file, JSON.stringify(more), psnr.toFixed(1));
        return psnr;
    };

    describe.each([['lossless.glb', 'loader'], ['lossless.glb', 'gltf'], ['balanced.glb', 'gltf'], ['balanced.ltgs', 'loader']] as const)('%s by the %s', (file, by) => {
        test.each(VIEWS)('%s', async (view) => {
            expect(await shot(file, { by, view, how: 'half' })).toBeGreaterThan(55);
            expect(await shot(file, { by, view, how: 'canvas' })).toBeGreaterThan(45);
            // Measured: 46.7 where the footprint of large maps decides, else 50 and more.
            expect(await shot(file, { by, view, how: 'half', precision: 'fast' })).toBeGreaterThan(45);
        });
    });

    test('floats and full precision show the reference to rounding', async () => expect(await shot('lossless.glb', { how: 'full' })).toBeGreaterThan(80));
    test('textures of half floats do', async () => expect(await shot('lossless.glb', { options: {} })).toBeGreaterThan(55));
    test('under a parent that is moved, turned and scaled the image is the same', async () => expect(await shot('lossless.glb', { parent: true, view: 'inside' })).toBeGreaterThan(55));
    test('cameras like those of a cube, whose images are upside down', async () => {
        const image = rgbOf(await run('image', { url: url('lossless.glb'), view: 'wide', how: 'half', control: 'upside-down' }));
        const turned = image.map((_, i) => image[image.length - 3 - i + 2 * (i % 3)]);
        expect(compare(turned, expected('lossless.glb', 'wide').rgb).psnr).toBeGreaterThan(55);
    });
    test('a canvas of two pixels per CSS pixel', async () => expect(await shot('lossless.glb', { pixelRatio: 2, how: 'canvas' })).toBeGreaterThan(45));
    test('after the loss of the context', async () => expect(await shot('lossless.glb', { restored: true })).toBeGreaterThan(55));
    test('multisampling changes nothing', async () => expect(await shot('lossless.glb', { renderer: { antialias: true }, how: 'canvas' })).toBeGreaterThan(45));
    test.each(['linear', 'linear-multisampled'] as const)('%s: a render target of linear light, with meshes', async (how) => {
        expect(await shot('lossless.glb', { how, behind: true })).toBeGreaterThan(55);
        const mesh: NonNullable<Shot['mesh']> = { colour: [0.2, 0.4, 0.6], distance: 0.01 };
        const hidden = rgbOf(await run('image', { url: url('lossless.glb'), view: 'wide', how, mesh }));
        expect(hidden.every((value, i) => Math.abs(value - [0.48453, 0.66519, 0.79774][i % 3]) < 1e-3)).toBe(true);
    });
    test('EffectComposer and OutputPass', async () => expect(await shot('lossless.glb', { how: 'composer-canvas', behind: true })).toBeGreaterThan(45));
    test.each(['linear-splats', 'linear-canvas'] as const)('%s: close, for blending differs', async (how) => {
        const psnr = await shot('lossless.glb', { how });
        expect(psnr).toBeGreaterThan(20);
        expect(psnr).toBeLessThan(45);
    });
    test.each(['order', 'mirrored'] as const)('control: %s fails', async (control) => {
        for (const precision of ['exact', 'fast'] as const) expect(await shot('lossless.glb', { control, precision })).toBeLessThan(40);
    });

    test.each([['two viewports', false], ['an ArrayCamera', true]] as const)('two cameras of one frame are both right: %s', async (_, asArray) => {
        for (const precision of ['exact', 'fast'] as const) {
            const images = await run('pair', url('lossless.glb'), ['wide', 'inside'], asArray, precision);
            for (const [i, view] of ['wide', 'inside'].entries()) {
                expect(compare(rgbOf(images[i]), expected('lossless.glb', view).rgb).psnr).toBeGreaterThan(45);
            }
        }
    });

    test('an opaque mesh hides splats behind it, and none before it', async () => {
        const hidden = rgbOf(await run('image', { url: url('lossless.glb'), view: 'wide', how: 'full', mesh: { colour: [0.2, 0.4, 0.6], distance: 0.01 } }));
        expect(hidden.every((value, i) => Math.abs(value - [0.2, 0.4, 0.6][i % 3]) < 1e-6)).toBe(true);
        // Of the colour of the background.
        expect(await shot('lossless.glb', { how: 'full', behind: true })).toBeGreaterThan(80);
    });

    const depths: [WebGLRendererParameters, boolean][] = [[{}, false], [{}, true], [{ reversedDepthBuffer: true }, false], [{ logarithmicDepthBuffer: true }, false]];
    test.each(depths)('a mesh cuts a splat along its plane: %o, tilted near plane: %s', async (parameters, tilted) => {
        for (const precision of ['exact', 'fast'] as const) {
            const { row, reversed, logarithmic } = await run('cut', parameters, tilted, precision);
            expect([reversed, logarithmic]).toEqual([Boolean(parameters.reversedDepthBuffer), Boolean(parameters.logarithmicDepthBuffer)]);
            // The disc comes nearer than the mesh to the left of x = 0.1, which is seen 1.85 px from the middle.
            expect(row.slice(28, 34).every((red) => red > 0.5)).toBe(true);
            expect(row.slice(34).every((red) => red === 0)).toBe(true);
        }
    });

    test('splats arrive in parts, while three.js uploads its own textures', async () => {
        const image = await run('parts', url('lossless.glb'), 'wide', 'exact');
        expect(compare(rgbOf(image), expected('lossless.glb', 'wide').rgb).psnr).toBeGreaterThan(80);
        const fast = await run('parts', url('lossless.glb'), 'wide', 'fast');
        const whole = await run('image', { url: url('lossless.glb'), view: 'wide', how: 'full', precision: 'fast' });
        expect(compare(rgbOf(fast), rgbOf(whole).map((value) => Math.min(1, Math.max(0, value)))).psnr).toBeGreaterThan(80);
    });

    test('the nearer object is drawn last, and renderOrder comes before that', async () => {
        expect((await run('stacked', false)).map((c) => Math.round(100 * c))).toEqual([99, 1, 0, 100]);
        expect((await run('stacked', true)).map((c) => Math.round(100 * c))).toEqual([1, 99, 0, 100]);
    });

    test.each([
        ['srgb_rec709_display', 'canvas', 0.5], ['srgb_rec709_display', 'target', 0.21404], ['lin_rec709_display', 'canvas', 0.73536], ['lin_rec709_display', 'target', 0.5],
    ] as const)('colours of %s in a %s', async (space, how, value) => {
        expect(Math.abs(await run('converted', space, how) - 0.99 * value)).toBeLessThan(how === 'canvas' ? 0.003 : 1e-3);
    });

    test.each(['untextured', 'texels', 'degree', 'depth'] as const)('colours show %s', async (colours) => {
        expect(await shot('lossless.glb', { colours })).toBeLessThan(45);
    });

    test('small turns are sorted in the worker, which onUpdate tells', async () => {
        const { before, after, exact, updates } = await run('turned', url('lossless.glb'), 'wide');
        expect(updates).toBe(1);
        expect(before.rgb === exact.rgb).toBe(false);
        expect(after.rgb === exact.rgb).toBe(true);
    });

    test('dispose frees textures, geometries and programs', async () => {
        const memory = await run('memory', url('lossless.glb'), 'wide');
        expect(memory).toEqual({ before: 0, with: 12, after: 0, geometries: 0, programs: 0, alive: false });
    });

    test.each(['lossless.glb', 'balanced.glb'])('%s as .gltf with other files, beside points', async (file) => {
        const { types, splats, scale } = await run('mixed', url(file));
        expect(types.sort()).toEqual(['Group', 'Group', 'LitetexSplats', 'PerspectiveCamera', 'Points']);
        expect(splats).toBeGreaterThan(10);
        expect(scale).toBeGreaterThan(0);
    });

    test('files of other kinds are refused', async () => expect(await run('failure', url('wide.png'))).toMatch(/SceneError: .*image/));
    test('WebGPURenderer is refused', async () => expect(await run('webgpu')).toContain('WebGLRenderer only'));
    test('the page shows no errors', () => expect(browser.errors).toEqual([]));
});
