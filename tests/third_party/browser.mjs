// Renders files with three.js in headless Chromium, on its software driver, from the cameras of a COLMAP capture.
//
//     node browser.mjs SIGMAS CAPTURE IMAGES OUT NAME=FILE.glb...
//
// SIGMAS: cut-off of splats in standard deviations, or "shipped" for an unmodified three.js, which uses 2. CAPTURE: must
// have sparse/0/*.txt. IMAGES: a folder with an image of each view to render. Writes OUT/NAME/VIEW.png.

import { spawn } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { basename, dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

const HERE = dirname(fileURLToPath(import.meta.url));
const BROWSERS = ['chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'];
const FLAGS = ['--headless=new', '--no-sandbox', '--disable-gpu-sandbox', '--no-first-run', '--enable-unsafe-webgpu',
    '--enable-features=Vulkan', '--use-webgpu-adapter=swiftshader'];
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.glb': 'model/gltf-binary' };
const TIMEOUT_MS = 240_000;
const [NEAR, FAR] = [0.01, 1000];

/** Lines of a COLMAP text file, without comments, split into fields. */
function rows(path) {
    return readFileSync(path, 'utf8').split('\n').filter((line) => !line.startsWith('#')).map((line) => line.split(' '));
}

/** `{name, width, height, view, projection}` of each image: column-major matrices, y up. */
function cameras(capture) {
    const model = join(capture, 'sparse', '0');
    const lenses = new Map(rows(join(model, 'cameras.txt')).filter((r) => r.length > 4).map((r) => [r[0], r]));
    // Two lines per image; the second lists its points.
    const images = rows(join(model, 'images.txt')).filter((_, i) => i % 2 === 0).filter((r) => r.length > 8);
    return images.map(([, qw, qx, qy, qz, tx, ty, tz, lens, name]) => {
        const [, kind, width, height, ...lensValues] = lenses.get(lens);
        if (kind !== 'PINHOLE') throw new Error(`camera model ${kind}, expected PINHOLE`);
        const [fx, fy, cx, cy] = lensValues.map(Number);
        const [w, h] = [Number(width), Number(height)];
        const [a, b, c, d] = [qw, qx, qy, qz].map(Number);
        const rotation = [
            [1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)],
        ];
        // Camera and world axes: COLMAP has y down and z forward, glTF y up and z backward.
        const flip = [1, -1, -1];
        const translation = [tx, ty, tz].map(Number);
        const view = [0, 1, 2].flatMap((column) => [...[0, 1, 2].map((row) => flip[row] * rotation[row][column] * flip[column]), 0]);
        view.push(...translation.map((t, row) => flip[row] * t), 1);
        // Depth from 0 to 1, as in WebGPU.
        const projection = [
            2 * fx / w, 0, 0, 0,
            0, 2 * fy / h, 0, 0,
            1 - 2 * cx / w, 2 * cy / h - 1, FAR / (NEAR - FAR), -1,
            0, 0, NEAR * FAR / (NEAR - FAR), 0,
        ];
        return { name: name.trim(), width: w, height: h, view, projection };
    });
}

/** Widens the cut-off in three.js' source: it is 2 standard deviations, where splats still have 14 % of their opacity. */
function widened(source, sigmas) {
    const replace = (text, from, to, times) => {
        const found = text.match(from)?.length;
        if (found !== times) throw new Error(`three.js has changed: found ${from} ${found ?? 0} times, expected ${times}`);
        return text.replace(from, to);
    };
    const corners = replace(source, /2, (- )?2, 0/g, `${sigmas}, $1${sigmas}, 0`, 4);
    return replace(corners, /r2\.greaterThan\( 4 \)/g, `r2.greaterThan( ${sigmas ** 2} )`, 1);
}

/** The response to a request of the page, or null. */
function contentOf(path, jobs, files) {
    if (path === '/jobs') return JSON.stringify(jobs);
    const file = files.get(path) ?? (path.startsWith('/node_modules/') ? join(HERE, path) : '');
    if (!existsSync(file)) return null;
    const isSplats = path.endsWith('/objects/GaussianSplat.js') && sigmas !== 'shipped';
    return isSplats ? widened(readFileSync(file, 'utf8'), Number(sigmas)) : readFileSync(file);
}

/** Serves the page, three.js and the files; resolves with the server and the page's report, once it comes. */
function serve(jobs, files, out) {
    let server;
    const report = new Promise((resolve, reject) => {
        const receive = (path, bytes) => {
            if (path === '/done') resolve(JSON.parse(bytes));
            if (path === '/failed') reject(new Error(`the page failed: ${bytes}`));
            if (!path.startsWith('/image/')) return;
            const file = join(out, path.slice('/image/'.length));
            mkdirSync(dirname(file), { recursive: true });
            writeFileSync(file, bytes);
        };
        server = createServer(async (request, response) => {
            const path = normalize(decodeURIComponent(new URL(request.url, 'http://localhost').pathname));
            if (request.method === 'POST') {
                const parts = [];
                for await (const part of request) parts.push(part);
                receive(path, Buffer.concat(parts));
                response.writeHead(200).end();
                return;
            }
            const bytes = contentOf(path, jobs, files);
            const type = TYPES[extname(path === '/' ? 'browser.html' : path)] ?? 'text/plain';
            response.writeHead(bytes === null ? 404 : 200, { 'Content-Type': type }).end(bytes);
        });
    });
    return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve({ report, server })));
}

const [sigmas, capture, images, out, ...named] = process.argv.slice(2);
const stem = (name) => basename(name, extname(name));
const selected = new Set(readdirSync(images, { recursive: true }).map(stem));
const views = cameras(capture).filter((camera) => selected.has(stem(camera.name)));
if (views.length === 0) throw new Error(`${images}: none of its images belongs to a view of ${capture}`);
const files = new Map([['/', join(HERE, 'browser.html')]]);
const jobs = named.map((argument) => {
    const [name, file] = argument.split(/=(.*)/s);
    files.set(`/files/${name}.glb`, file);
    return { url: `/files/${name}.glb`, views: views.map((view) => ({ ...view, name: `${name}/${stem(view.name)}.png` })) };
});
const browser = BROWSERS.find((name) => (process.env.PATH ?? '').split(':').some((folder) => existsSync(join(folder, name))));
if (!browser) throw new Error('Chromium is not installed');
const profile = mkdtempSync(join(tmpdir(), 'litetex-browser-'));
const { report, server } = await serve(jobs, files, out);
const started = Date.now();
const child = spawn(browser, [...FLAGS, `--user-data-dir=${profile}`, `http://127.0.0.1:${server.address().port}/`], { stdio: 'ignore', detached: true });
const failure = new Promise((_, reject) => {
    child.on('error', reject);
    child.on('exit', (code) => reject(new Error(`${browser} exited with ${code}`)));
    setTimeout(() => reject(new Error(`no report within ${TIMEOUT_MS / 1000} s`)), TIMEOUT_MS).unref();
});
failure.catch(() => {});
try {
    const { backend, three } = await Promise.race([report, failure]);
    console.log(JSON.stringify({ backend, three, views: views.length, secs: (Date.now() - started) / 1000 }));
} finally {
    // The group: helper processes that outlive the browser would go on writing into its profile.
    try {
        process.kill(-child.pid, 'SIGKILL');
    } catch {} // It has exited.
    server.closeAllConnections();
    server.close();
    if (child.exitCode === null && child.signalCode === null) await new Promise((resolve) => child.once('close', resolve));
    rmSync(profile, { recursive: true, force: true, maxRetries: 20 });
}
