/** The listings of `exporters/schema/draw.md`, as they stand there, against `litetex render`. */

import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { BrowserTest, browserPath, WEBGPU_FLAGS } from './browser';
import type { Control, drawing, Listings } from './draw-harness';
import { compare, reference, type FloatImage } from './reference';

const REPOSITORY = join(import.meta.dirname, '../../..');
const LITETEX = process.env.LITETEX ?? join(REPOSITORY, 'target/debug/litetex');
const ASSETS = process.env.LITETEX_ASSETS ?? join(REPOSITORY, 'target/web-assets');
const PACK = join(REPOSITORY, 'samples/conformance');
const DOCUMENT = readFileSync(join(REPOSITORY, 'exporters/schema/draw.md'), 'utf8');

const blocks = (language: string) => [...DOCUMENT.matchAll(new RegExp(`^\`\`\`${language}\n([^]*?)^\`\`\`$`, 'gm'))].map(([, code]) => code);
const [vertex, fragment] = blocks('glsl');
const [wgsl] = blocks('wgsl');
const LANGUAGES: [string, Listings][] = [['GLSL', { vertex, fragment }], ['WGSL', { wgsl }]];
/** What the listings must reach in the conformance pack. */
const PACK_DB = 75;

const references = new Map<string, FloatImage>();
function expected(file: string, view: string): FloatImage {
    const key = `${file} ${view}`;
    if (!references.has(key)) references.set(key, reference(LITETEX, file, view));
    return references.get(key)!;
}

test('listings have at most 100 lines', () => {
    for (const language of ['glsl', 'wgsl']) expect(blocks(language).join('').split('\n').length - 1).toBeLessThanOrEqual(100);
    expect([blocks('glsl').length, blocks('wgsl').length]).toEqual([2, 1]);
});

describe.skipIf(!browserPath())('drawn', () => {
    let browser: BrowserTest;
    beforeAll(async () => { browser = await BrowserTest.open('tests/browser/draw.html', [REPOSITORY, ASSETS], undefined, WEBGPU_FLAGS); });
    afterAll(() => browser?.close());

    /** PSNR against the program, dB. */
    async function quality(listings: Listings, file: string, view: string, control?: Control): Promise<number> {
        const { width, height, rgb } = await browser.page.evaluate((job) => (window as unknown as { drawing: typeof drawing }).drawing(job), { url: `/@fs/${file}`, view, listings, ...(control && { control }) });
        const image = expected(file, view);
        expect([width, height]).toEqual([image.width, image.height]);
        const { psnr } = compare(Float32Array.from(rgb), image.rgb);
        if (process.env.LITETEX_FIGURES) console.log('wgsl' in listings ? 'WGSL' : 'GLSL', file, view, control ?? '', psnr.toFixed(1));
        return psnr;
    }

    describe.each(LANGUAGES)('%s', (_, listings) => {
        test.each([join(PACK, 'lossless.glb'), join(PACK, 'balanced.ltgs'), join(ASSETS, 'lossless.glb')])('%s', async (file) => {
            // Measured: 84.6 and more; 69.6 in the larger scene.
            for (const view of ['wide', 'side', 'inside']) expect(await quality(listings, file, view)).toBeGreaterThan(file.startsWith(PACK) ? PACK_DB : 62);
        });

        const file = join(PACK, 'lossless.glb');
        test.each<Control>(['order', 'no-texels', 'transposed', 'half-pixel'])('control: %s fails', async (control) => expect(await quality(listings, file, 'wide', control)).toBeLessThan(40));

        test.each([
            ['a map half a texel off', / - 1\.0 - (splat\.)?shift/, ' - $1shift'],
            ['another constant', /0\.28209479/, '0.5'],
            ['a cut at three sigmas', /alpha < 1\.0 \/ 255\.0/, 'dot(s, s) > 9.0'],
            ['half of the filter', /variance \* dot\(mv, mv\)/, '0.0'],
        ])('control: a listing with %s fails', async (_name, from, to) => {
            const other = Object.fromEntries(Object.entries(listings).map(([part, code]) => [part, (code as string).replace(from, to)])) as Listings;
            expect(other).not.toEqual(listings);
            expect(await quality(other, file, 'wide')).toBeLessThan(PACK_DB);
        });
    });

    test('the page shows no errors', () => expect(browser.errors).toEqual([]));
});
