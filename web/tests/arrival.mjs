// What is shown of a file while it arrives: node tests/arrival.mjs OUT.png FILE...
//
// Writes a sheet with a row for each .ltgs or .glb file: its home view after parts of its bytes. Prints the PSNR against the whole file, dB,
// as the mean of eight views.
import { writeFileSync, realpathSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { createServer } from 'vite';

const [out, ...files] = process.argv.slice(2);
if (files.length === 0) throw new Error('usage: node tests/arrival.mjs OUT.png FILE...');
const PARTS = [0.05, 0.1, 0.125, 0.15, 0.25, 0.5, 0.75, 0.9, 1];
const SHOWN = [0.05, 0.1, 0.15, 0.25, 0.5, 1];

const args = ['--no-sandbox', '--disable-quic', '--no-first-run', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true, args });
const root = fileURLToPath(new URL('..', import.meta.url));
const server = await createServer({ root, configFile: false, logLevel: 'error', server: { port: 0, host: '127.0.0.1', fs: { strict: false }, hmr: false, watch: null }, optimizeDeps: { noDiscovery: true } });
await server.listen();
const page = await browser.newPage({ viewport: { width: 1800, height: 900 } });
page.on('pageerror', (error) => console.error(String(error)));
await page.goto(`${server.resolvedUrls.local[0]}tests/browser/harness.html`);
await page.waitForFunction(() => 'ready' in window);
await page.evaluate(() => { document.body.style.cssText = 'margin: 8px; background: white; font: 14px sans-serif'; });
for (const file of files) {
    const psnr = await page.evaluate(async ([url, parts, shown]) => {
        const { SplatRenderer } = await import('/src/core/render/renderer.ts');
        const { readScene } = await import('/src/core/read/index.ts');
        const { viewOf } = await import('/src/core/render/view.ts');
        const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
        const row = document.createElement('div');
        row.style.cssText = 'display: flex; gap: 8px; margin-bottom: 8px';
        document.body.append(row);
        const held = (value) => Math.min(1, Math.max(0, value));
        const images = [];
        for (const part of parts) {
            const canvas = document.createElement('canvas'), renderer = new SplatRenderer(canvas, {});
            let seen = false;
            const seeing = (take) => (given) => { take(given); seen = true; };
            await readScene(bytes.slice(0, Math.round(part * bytes.length)), {
                fileBytes: bytes.length, onInfo: (info) => renderer.start(info),
                onStandIn: seeing((splats) => renderer.setStandIn(splats)), onUpdate: seeing((update) => renderer.apply(update)),
            }).catch(() => {}); // cut off
            const { cameras, home } = renderer.info;
            const some = Array.from({ length: 8 }, (_, i) => cameras[Math.floor(i * cameras.length / 8)]);
            const views = [...some, cameras[home ?? 0]];
            const all = [];
            for (const camera of views) {
                const view = viewOf(camera);
                [canvas.width, canvas.height] = [view.widthPx, view.heightPx];
                if (!seen) { all.push(null); continue; }
                await renderer.sorted(view);
                renderer.draw(view);
                all.push(renderer.read());
            }
            images.push(all.slice(0, 8));
            if (shown.includes(part)) {
                const figure = document.createElement('div'), image = new Image(), text = document.createElement('div');
                text.textContent = `${Math.round(100 * part)} %`;
                image.style.height = '260px';
                if (seen) renderer.draw(viewOf(cameras[home ?? 0]));
                image.src = canvas.toDataURL();
                await image.decode();
                figure.append(image, text);
                row.append(figure);
            }
            renderer.dispose();
        }
        const whole = images.at(-1);
        const psnrOf = (a, b) => -10 * Math.log10(a.reduce((sum, v, i) => sum + (i % 4 < 3 ? (held(v) - held(b[i])) ** 2 : 0), 0) / (0.75 * a.length));
        return images.map((all) => all.reduce((sum, image, i) => sum + (image ? psnrOf(image, whole[i]) : 0), 0) / 8);
    }, [`/@fs/${realpathSync(file)}`, PARTS, SHOWN]);
    console.log(file, PARTS.map((part, i) => `${100 * part} %: ${psnr[i] === 0 ? 'nothing' : psnr[i].toFixed(1)}`).join(', '));
}
writeFileSync(out, await page.screenshot({ fullPage: true }));
await browser.close();
await server.close();
