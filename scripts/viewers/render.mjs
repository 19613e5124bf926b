// Renders files in other programs, each in a page of headless Chromium on its software drivers:
//
//     node render.mjs JOBS.json OUT
//
// JOBS.json: `[{name, program, file, options, camera}]`. `program` names a module beside this file, `file` what it loads, and
// `camera` is `{width, height, worldFromCamera, window: {left, right, bottom, top}, near}`: a column-major matrix of a camera that
// looks along -z with y up, and its image at depth 1. Writes OUT/NAME.png for each job, and OUT/report.json with what failed.
//
// Jobs with `times` are measured, too, when all are loaded: that many times, each draws two images in turn with the others, and the
// report has the CPU milliseconds of the browser's graphics process an image. LITETEX_DRIVER: `swiftshader` (default) or `gl-egl`, Mesa's.

import { createReadStream, existsSync, mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';

const HERE = dirname(fileURLToPath(import.meta.url));
const BROWSERS = ['chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'];
const DRIVER = process.env.LITETEX_DRIVER ?? 'swiftshader';
const DRIVERS = {
    swiftshader: ['--enable-unsafe-webgpu', '--use-webgpu-adapter=swiftshader', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
        '--use-vulkan=swiftshader', '--enable-features=Vulkan,WebGPU'],
    'gl-egl': ['--use-angle=gl-egl', '--ignore-gpu-blocklist'],
};
const FLAGS = ['--headless=new', '--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', ...DRIVERS[DRIVER]];
const IMAGES = 2, MS_PER_TICK = 10;
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.wasm': 'application/wasm', '.json': 'application/json' };
const TIMEOUT_MS = 240_000;

/** Where the names that a module imports are found; both builds of three go by the same name. */
function imports(program) {
    const three = program === 'three' ? 'three.webgpu.js' : 'three.module.js';
    return {
        three: `/node_modules/three/build/${three}`,
        'three/webgpu': '/node_modules/three/build/three.webgpu.js',
        'three/tsl': '/node_modules/three/build/three.tsl.js',
        'three/addons/': '/node_modules/three/examples/jsm/',
        '@sparkjsdev/spark': '/node_modules/@sparkjsdev/spark/dist/spark.module.js',
        '@babylonjs/': '/node_modules/@babylonjs/',
        'babylonjs-gltf2interface': '/empty.mjs',
        playcanvas: '/node_modules/playcanvas/build/playcanvas.mjs',
    };
}

function page(job) {
    return `<!doctype html><meta charset="utf-8"><body style="margin:0">
<script type="importmap">${JSON.stringify({ imports: imports(job.program) })}</script>
<script type="module">
import { render } from '/${job.program}.mjs';
import { png } from '/png.mjs';
const done = (result) => { window.result = result; };
addEventListener('unhandledrejection', (event) => done({ error: String(event.reason?.stack ?? event.reason) }));
try {
    const job = ${JSON.stringify(job)};
    const { draw, figures, ...image } = await render(job);
    window.draw = draw;
    done({ png: await png(image), figures });
} catch (error) {
    done({ error: String(error?.stack ?? error) });
}
</script>`;
}

function serve(jobs) {
    const server = createServer((request, response) => {
        const path = normalize(decodeURIComponent(new URL(request.url, 'http://localhost').pathname));
        const [, kind, index] = path.split('/');
        if (kind === 'job') return response.writeHead(200, { 'Content-Type': 'text/html' }).end(page(jobs[Number(index)]));
        if (path === '/favicon.ico') return response.writeHead(204).end();
        if (path === '/empty.mjs') return response.writeHead(200, { 'Content-Type': 'text/javascript' }).end('export {};');
        const file = kind === 'files' ? jobs[Number(index)].file : kind === 'litetex' ? join(process.env.LITETEX_WEB ?? '', path.slice(8)) : join(HERE, path);
        if (!existsSync(file)) return response.writeHead(404).end();
        response.writeHead(200, { 'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream' });
        return createReadStream(file).pipe(response);
    });
    return new Promise((resolve) => server.listen(0, '127.0.0.1', () => resolve(server)));
}

/** CPU milliseconds of the graphics process of our browser, not of another that runs at the same time, so far. */
function spentMs() {
    const read = (pid, name) => { try { return readFileSync(`/proc/${pid}/${name}`, 'utf8'); } catch { return ''; } };
    const fields = (pid) => (read(pid, 'stat').split(') ')[1] ?? '').split(' ');
    const isOurs = (pid) => pid === process.pid || (pid > 1 && isOurs(Number(fields(pid)[1])));
    for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
        if (!read(pid, 'cmdline').includes('--type=gpu-process') || !isOurs(Number(pid))) continue;
        const [user, system] = fields(pid).slice(11, 13).map(Number);
        return MS_PER_TICK * (user + system);
    }
    throw new Error('the browser has no graphics process');
}

const [jobsFile, out] = process.argv.slice(2);
const jobs = JSON.parse(readFileSync(jobsFile, 'utf8')).map((job, i) => ({ ...job, url: `/files/${i}/${job.file.split('/').pop()}` }));
const executablePath = (process.env.PATH ?? '').split(':').flatMap((folder) => BROWSERS.map((name) => join(folder, name))).find(existsSync);
if (!executablePath) throw new Error('Chromium is not installed');
mkdirSync(out, { recursive: true });
const server = await serve(jobs);
const browser = await chromium.launch({ executablePath, args: FLAGS });
const report = {}, measured = new Map();
try {
    for (const [i, job] of jobs.entries()) {
        const tab = await browser.newPage();
        const said = [];
        tab.on('console', (message) => ['error', 'warning'].includes(message.type()) && said.push(message.text()));
        tab.on('pageerror', (error) => said.push(String(error)));
        await tab.goto(`http://127.0.0.1:${server.address().port}/job/${i}`);
        const waited = tab.waitForFunction(() => window.result, null, { timeout: TIMEOUT_MS }).then((handle) => handle.jsonValue());
        const result = await waited.catch((error) => ({ error: String(error) }));
        if (result.png) writeFileSync(join(out, `${job.name}.png`), Buffer.from(result.png, 'base64'));
        report[job.name] = { error: result.error ?? null, said: said.slice(0, 5), figures: result.figures };
        console.log(`${job.name}: ${result.error ?? 'rendered'}${said.length ? ` (${said[0].slice(0, 160)})` : ''}`);
        if (job.times && !result.error) measured.set(job, tab);
        else await tab.close();
    }
    // The first of each is not counted.
    for (let time = 0; time <= Math.max(...[...measured.keys()].map(({ times }) => times)); time++) {
        for (const [job, tab] of measured) {
            const before = spentMs();
            for (let i = 0; i < IMAGES; i++) await tab.evaluate((image) => window.draw(image), i);
            if (time > 0) (report[job.name].cpuMs ??= []).push((spentMs() - before) / IMAGES);
        }
    }
} finally {
    await browser.close();
    server.close();
}
writeFileSync(join(out, 'report.json'), JSON.stringify(report, null, 1));
