// Renders files by three.js in headless Chromium, on its software driver, from the cameras of a capture of COLMAP.
//
//     node browser.mjs SIGMAS CAPTURE IMAGES OUT NAME=FILE.glb...
//
// SIGMAS: standard deviations out to which splats are drawn, or "shipped": 2, as three.js has it. CAPTURE: with
// sparse/0/*.txt. IMAGES: the views are those whose images lie here. Writes OUT/NAME/VIEW.png.

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
const PATIENCE_MS = 240_000;
const [NEAR, FAR] = [0.01, 1000];

/** Rows of numbers and words of a text file of COLMAP. */
function rows(path) {
    return readFileSync(path, 'utf8').split('\n').filter((line) => !line.startsWith('#')).map((line) => line.split(' '));
}

/** `{name, width, height, view, projection}` of each image, column-major matrices, world with y up. */
function cameras(capture) {
    const model = join(capture, 'sparse', '0');
    const lenses = new Map(rows(join(model, 'cameras.txt')).filter((r) => r.length > 4).map((r) => [r[0], r]));
    // Two lines an image; the second holds its points.
    const images = rows(join(model, 'images.txt')).filter((_, i) => i % 2 === 0).filter((r) => r.length > 8);
    return images.map(([, qw, qx, qy, qz, tx, ty, tz, lens, name]) => {
        const [, kind, width, height, ...lensValues] = lenses.get(lens);
        if (kind !== 'PINHOLE') throw new Error(`${kind}: only PINHOLE`);
        const [fx, fy, cx, cy] = lensValues.map(Number);
        const [w, h] = [Number(width), Number(height)];
        const [a, b, c, d] = [qw, qx, qy, qz].map(Number);
        const rotation = [
            [1 - 2 * (c * c + d * d), 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), 1 - 2 * (b * b + d * d), 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), 1 - 2 * (b * b + c * c)],
        ];
        // COLMAP's axes, of camera and world, have y down and z forward; those of glTF y up and z back.
        const flip = [1, -1, -1];
        const translation = [tx, ty, tz].map(Number);
        const view = [0, 1, 2].flatMap((column) => [...[0, 1, 2].map((row) => flip[row] * rotation[row][column] * flip[column]), 0]);
        view.push(...translation.map((t, row) => flip[row] * t), 1);
        // Depth from 0 to 1, as WebGPU has it.
        const projection = [
            2 * fx / w, 0, 0, 0,
            0, 2 * fy / h, 0, 0,
            1 - 2 * cx / w, 2 * cy / h - 1, FAR / (NEAR - FAR), -1,
            0, 0, NEAR * FAR / (NEAR - FAR), 0,
        ];
        return { name: name.trim(), width: w, height: h, view, projection };
    });
}

/** three.js cuts splats off at 2 standard deviations, where they still have 14 % of their opacity: takes another radius. */
function widened(source, sigmas) {
    const replace = (text, from, to, times) => {
        const found = text.match(from)?.length;
        if (found !== times) throw new Error(`three.js has changed: ${from} is there ${found} times, expected ${times}`);
        return text.replace(from, to);
    };
    const corners = replace(source, /2, (- )?2, 0/g, `${sigmas}, $1${sigmas}, 0`, 4);
    return replace(corners, /r2\.greaterThan\( 4 \)/g, `r2.greaterThan( ${sigmas ** 2} )`, 1);
}

/** The bytes behind a path that the page asks for, or nothing. */
function found(path, jobs, files) {
    if (path === '/jobs') return JSON.stringify(jobs);
    const file = files.get(path) ?? (path.startsWith('/node_modules/') ? join(HERE, path) : '');
    if (!existsSync(file)) return null;
    const isSplats = path.endsWith('/objects/GaussianSplat.js') && sigmas !== 'shipped';
    return isSplats ? widened(readFileSync(file, 'utf8'), Number(sigmas)) : readFileSync(file);
}

/** Serves the page, three.js and the files; resolves with the server and the page's coming report. */
function serve(jobs, files, out) {
    let server;
    const report = new Promise((resolve, reject) => {
        const take = (path, bytes) => {
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
                take(path, Buffer.concat(parts));
                response.writeHead(200).end();
                return;
            }
            const bytes = found(path, jobs, files);
            const type = TYPES[extname(path === '/' ? 'browser.html' : path)] ?? 'text/plain';
            response.writeHead(bytes === null ? 404 : 200, { 'Content-Type': type }).end(bytes);
        });
    });
    return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve({ report, server })));
}

const [sigmas, capture, images, out, ...named] = process.argv.slice(2);
const stem = (name) => basename(name, extname(name));
const wanted = new Set(readdirSync(images, { recursive: true }).map(stem));
const views = cameras(capture).filter((camera) => wanted.has(stem(camera.name)));
if (views.length === 0) throw new Error(`${images}: no images of views of ${capture}`);
const files = new Map([['/', join(HERE, 'browser.html')]]);
const jobs = named.map((argument) => {
    const [name, file] = argument.split(/=(.*)/s);
    files.set(`/files/${name}.glb`, file);
    return { url: `/files/${name}.glb`, views: views.map((view) => ({ ...view, name: `${name}/${stem(view.name)}.png` })) };
});
const browser = BROWSERS.find((name) => (process.env.PATH ?? '').split(':').some((folder) => existsSync(join(folder, name))));
if (!browser) throw new Error('Chromium is not installed');
const profile = mkdtempSync(join(tmpdir(), 'judge-'));
const { report, server } = await serve(jobs, files, out);
const started = Date.now();
const child = spawn(browser, [...FLAGS, `--user-data-dir=${profile}`, `http://127.0.0.1:${server.address().port}/`], { stdio: 'ignore' });
const gone = new Promise((_, reject) => {
    child.on('error', reject);
    child.on('exit', (code) => reject(new Error(`${browser} ended with ${code}`)));
    setTimeout(() => reject(new Error(`no report within ${PATIENCE_MS / 1000} s`)), PATIENCE_MS).unref();
});
gone.catch(() => {});
try {
    const { backend, three } = await Promise.race([report, gone]);
    console.log(JSON.stringify({ backend, three, views: views.length, secs: (Date.now() - started) / 1000 }));
} finally {
    child.kill('SIGKILL');
    server.closeAllConnections();
    server.close();
    await new Promise((resolve) => child.once('close', resolve));
    rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
}
