// What an image costs in two versions of the package: node tests/cost.mjs FILE OTHER_WEB [swiftshader | gl-egl]
//
// FILE: a .ltgs or .glb file. OTHER_WEB: the folder `web` of another version, with node_modules. Prints the CPU milliseconds of the
// browser's graphics process an image, medians of all variants in turn, least in brackets, and whether both versions' exact images are the
// same bytes; of fast ones the PSNR against exact ones, into 16 bits and of the canvas.
import { readdirSync, readFileSync, realpathSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { createServer } from 'vite';

const [file, other, driver = 'swiftshader'] = process.argv.slice(2);
if (!other) throw new Error('usage: node tests/cost.mjs FILE OTHER_WEB [swiftshader | gl-egl]');
const versions = { other: realpathSync(other), this: fileURLToPath(new URL('..', import.meta.url)) };
const SIZES = [[270, 480], [1440, 900]];
const ROUNDS = 5, IMAGES = 2, MS_PER_TICK = 10;

const drivers = { swiftshader: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader'], 'gl-egl': ['--use-angle=gl-egl', '--ignore-gpu-blocklist'] };
const args = ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'];
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true, args: [...args, ...drivers[driver]] });
const servers = [], pages = {};

/** Draws with the sources of a version, in a page of its own. */
async function open(root) {
    const server = await createServer({ root, configFile: false, logLevel: 'error', server: { port: 0, host: '127.0.0.1', fs: { strict: false }, hmr: false, watch: null }, optimizeDeps: { noDiscovery: true } });
    await server.listen();
    servers.push(server);
    const page = await browser.newPage();
    page.on('pageerror', (error) => console.error(String(error)));
    await page.goto(`${server.resolvedUrls.local[0]}tests/browser/harness.html`);
    await page.waitForFunction(() => 'ready' in window);
    await page.evaluate(async (url) => {
        const { SplatRenderer } = await import('/src/core/render/renderer.ts');
        const { readFrom } = await import('/src/core/worker/read-from.ts');
        const { viewOf } = await import('/src/core/render/view.ts');
        const canvas = document.createElement('canvas'), renderer = new SplatRenderer(canvas, {}), { gl } = renderer;
        await readFrom({ url }, Infinity, (message) => {
            if (message.kind === 'info') renderer.start(message.info);
            if (message.kind === 'update') renderer.apply(message.update);
        });
        let view;
        const pixels = () => {
            const bytes = new Uint8Array(4 * canvas.width * canvas.height);
            gl.bindFramebuffer(gl.FRAMEBUFFER, null);
            gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
            return bytes;
        };
        const psnr = (a, b, peak) => {
            const held = (value) => Math.min(1, Math.max(0, value / peak));
            return -10 * Math.log10(a.reduce((sum, value, i) => sum + (i % 4 < 3 ? (held(value) - held(b[i])) ** 2 : 0), 0) / (0.75 * a.length));
        };
        window.prepare = async ([width, height]) => {
            view = viewOf(renderer.info.cameras[0], width, height);
            [canvas.width, canvas.height] = [view.widthPx, view.heightPx];
            await renderer.sorted(view);
            renderer.draw(view);
            const exact = renderer.read(), shown = pixels();
            const digest = [...new Uint8Array(await crypto.subtle.digest('SHA-256', exact.buffer))].join();
            renderer.draw(view, { precision: 'fast' });
            const fast = psnr(renderer.read(), exact, 1);
            renderer.draw(view, { precision: 'fast', onCanvas: true });
            return { digest, fast, onCanvas: psnr(pixels(), shown, 255) };
        };
        window.drawn = (images, options) => {
            for (let i = 0; i < images; i++) {
                // Turned a little, which changes no order.
                const turned = { ...view, rotation: view.rotation.map((value, k) => (k < 3 ? value : value + 1e-7 * (i % 2))) };
                renderer.draw(turned, options);
            }
            gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits
        };
    }, `/@fs/${realpathSync(file)}`);
    return page;
}

/** CPU milliseconds of the graphics process so far. */
function spentMs() {
    for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
        const of = (name) => { try { return readFileSync(`/proc/${pid}/${name}`, 'utf8'); } catch { return ''; } };
        if (!of('cmdline').includes('--type=gpu-process') || !of('cmdline').includes(driver)) continue;
        const fields = of('stat').split(') ')[1].split(' ');
        return MS_PER_TICK * (Number(fields[11]) + Number(fields[12]));
    }
    throw new Error('the browser has no graphics process');
}

const VARIANTS = {
    other: ['other', {}],
    exact: ['this', {}],
    fast: ['this', { precision: 'fast' }],
    'fast on the canvas': ['this', { precision: 'fast', onCanvas: true }],
};
for (const [name, root] of Object.entries(versions)) pages[name] = await open(root);
for (const size of SIZES) {
    const prepared = {}, costs = Object.fromEntries(Object.keys(VARIANTS).map((name) => [name, []]));
    for (const name of Object.keys(pages)) prepared[name] = await pages[name].evaluate((size) => window.prepare(size), size);
    for (let round = 0; round < ROUNDS; round++) {
        for (const [name, [version, options]] of Object.entries(VARIANTS)) {
            const before = spentMs();
            await pages[version].evaluate(([images, options]) => window.drawn(images, options), [IMAGES, options]);
            costs[name].push((spentMs() - before) / IMAGES);
        }
    }
    const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
    const cells = Object.entries(costs).map(([name, values]) => `${name} ${median(values)} (${Math.min(...values)}) ms, x ${(median(values) / median(costs.other)).toFixed(2)}`);
    const { digest, fast, onCanvas } = prepared.this;
    console.log(`${driver} ${size.join(' x ')}: ${cells.join('; ')}; ${digest === prepared.other.digest ? 'the same bytes' : 'other bytes'}; fast ${fast.toFixed(1)} dB, on the canvas ${onCanvas.toFixed(1)} dB`);
}
await browser.close();
await Promise.all(servers.map((server) => server.close()));
