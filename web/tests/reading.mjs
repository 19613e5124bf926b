// What reading costs in two versions of the package: node tests/reading.mjs FILE OTHER_WEB [ROUNDS]
//
// FILE: a .ltgs or .glb file. OTHER_WEB: the folder `web` of another version, with node_modules. Prints seconds until a file in memory is
// read, in Chromium: until the first update, until the end, and CPU seconds of the page's process, all workers included; medians of all
// variants in turn, least in brackets. A browser of its own for each: programs are compiled anew.
import { readdirSync, readFileSync, realpathSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { createServer } from 'vite';

const [file, other, rounds = '5'] = process.argv.slice(2);
if (!other) throw new Error('usage: node tests/reading.mjs FILE OTHER_WEB [ROUNDS]');
const own = fileURLToPath(new URL('..', import.meta.url));
/** Roots, and cores that the browser states. */
const VARIANTS = { other: [realpathSync(other), 2], 'one worker': [own, 1], 'two workers': [own, 2] };
const TICKS_PER_SECOND = 100;

const servers = {};
for (const [root] of Object.values(VARIANTS)) {
    servers[root] ??= await createServer({ root, configFile: false, logLevel: 'error', server: { port: 0, host: '127.0.0.1', fs: { strict: false }, hmr: false, watch: null }, optimizeDeps: { noDiscovery: true } }).then((server) => server.listen());
}

const processes = () => readdirSync('/proc').filter((name) => {
    try { return /^\d+$/.test(name) && readFileSync(`/proc/${name}/cmdline`, 'utf8').includes('--type=renderer'); } catch { return false; }
});
/** CPU seconds of processes so far. */
const spent = (pids) => pids.reduce((sum, pid) => {
    const fields = readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ')[1].split(' ');
    return sum + (Number(fields[11]) + Number(fields[12])) / TICKS_PER_SECOND;
}, 0);

async function read([root, cores]) {
    const before = new Set(processes());
    const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium', headless: true, args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking'] });
    const page = await browser.newPage();
    await page.addInitScript(`Object.defineProperty(navigator, 'hardwareConcurrency', { value: ${cores} })`);
    await page.goto(`${servers[root].resolvedUrls.local[0]}tests/browser/harness.html`);
    await page.waitForFunction(() => 'ready' in window);
    await page.evaluate(async (url) => {
        const [{ openScene }, response] = await Promise.all([import('/src/core/index.ts'), fetch(url)]);
        const bytes = await response.arrayBuffer();
        window.read = async () => {
            const start = performance.now();
            let first = 0, splats = 0;
            await openScene({ bytes }, () => {}, (update) => {
                first ||= performance.now() - start;
                splats = update.first + update.splats.count;
            }).done;
            return { first: first / 1e3, end: (performance.now() - start) / 1e3, splats };
        };
    }, `/@fs/${realpathSync(file)}`);
    const pids = processes().filter((pid) => !before.has(pid));
    const start = spent(pids);
    const figures = await page.evaluate(() => window.read());
    const cpu = spent(pids) - start;
    await browser.close();
    return { ...figures, cpu };
}

const all = Object.fromEntries(Object.keys(VARIANTS).map((name) => [name, []]));
for (let round = 0; round < Number(rounds); round++) for (const [name, variant] of Object.entries(VARIANTS)) all[name].push(await read(variant));
for (const [name, figures] of Object.entries(all)) {
    const cells = ['first', 'end', 'cpu'].map((key) => {
        const sorted = figures.map((one) => one[key]).sort((a, b) => a - b);
        return `${key} ${sorted[sorted.length >> 1].toFixed(2)} (${sorted[0].toFixed(2)}) s`;
    });
    console.log(`${name}: ${figures[0].splats} splats; ${cells.join('; ')}`);
}
await Promise.all(Object.values(servers).map((server) => server.close()));
