/** What `npm pack` would publish. */

import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { gzipSync } from 'node:zlib';
import { beforeAll, expect, test } from 'vitest';

const WEB = join(import.meta.dirname, '../..');
const manifest = JSON.parse(readFileSync(join(WEB, 'package.json'), 'utf8')) as {
    exports: Record<string, { types: string; default: string }>; scripts: Record<string, string>; dependencies?: object;
};

beforeAll(() => {
    execFileSync('npm', ['run', '--silent', 'build'], { cwd: WEB, stdio: 'pipe' });
}, 120_000);

/** A module of the package and all that it imports at once. */
function closure(path: string, seen = new Set<string>()): Set<string> {
    if (seen.has(path)) return seen;
    seen.add(path);
    for (const [, name] of readFileSync(path, 'utf8').matchAll(/(?:from|import)\s*["'`](\.[^"'`]+)["'`]/g)) closure(join(path, '..', name), seen);
    return seen;
}

const gzipBytes = (entry: string) => gzipSync(Buffer.concat([...closure(join(WEB, manifest.exports[entry].default))].map((path) => readFileSync(path))), { level: 9 }).length;

test('only modules, types, licences and the README are packed', () => {
    const [{ files }] = JSON.parse(execFileSync('npm', ['pack', '--dry-run', '--json'], { cwd: WEB, encoding: 'utf8' })) as [{ files: { path: string; size: number }[] }];
    const unexpected = files.map(({ path }) => path).filter((path) => !/^(dist\/[\w-]+\.js|dist\/types\/[\w/-]+\.d\.ts|package\.json|README\.md|LICENSE-(MIT|APACHE))$/.test(path));
    expect(unexpected).toEqual([]);
    for (const name of ['LICENSE-MIT', 'LICENSE-APACHE', 'README.md']) expect(files.map(({ path }) => path)).toContain(name);
    expect(files.reduce((sum, { size }) => sum + size, 0)).toBeLessThan(400_000);
});

test('nothing runs when it is installed', () => {
    expect(Object.keys(manifest.scripts).filter((name) => /install|prepare|prepack|publish/.test(name))).toEqual([]);
});

test('every entry point is there, with its types', () => {
    for (const { types, default: module } of Object.values(manifest.exports)) expect([types, module].filter((path) => !existsSync(join(WEB, path)))).toEqual([]);
});

test.each(['bundler', 'nodenext'])('types resolve as %s does it', (resolution) => {
    const folder = mkdtempSync(join(WEB, 'node_modules/.consumer-'));
    try {
        writeFileSync(join(folder, 'package.json'), JSON.stringify({ type: 'module', dependencies: {} }));
        writeFileSync(join(folder, 'page.ts'), `
            import { openScene, SplatRenderer, viewOf } from 'litetex';
            import { readScene } from 'litetex/read';
            import { LitetexLoader } from 'litetex/three';
            import { loadSplats } from 'litetex/playcanvas';
            import { LitetexViewerElement } from 'litetex/element';
            const renderer = new SplatRenderer(document.createElement('canvas'));
            openScene({ url: 'scene.ltgs' }, (info) => renderer.start(info), (update) => renderer.apply(update));
            const splats: number = (await readScene(new Uint8Array())).splats;
            document.querySelector('litetex-viewer')!.addEventListener('progress', (event) => console.log(event.loaded));
            console.log(viewOf, LitetexLoader, loadSplats, LitetexViewerElement, splats);
        `);
        const options = { target: 'es2022', module: resolution === 'bundler' ? 'esnext' : 'nodenext', moduleResolution: resolution, strict: true, noEmit: true, lib: ['es2023', 'dom'], types: [] };
        mkdirSync(join(folder, 'node_modules'));
        symlinkSync(WEB, join(folder, 'node_modules/litetex'));
        writeFileSync(join(folder, 'tsconfig.json'), JSON.stringify({ compilerOptions: { ...options, skipLibCheck: true }, files: ['page.ts'] }));
        execFileSync('npx', ['tsc', '-p', folder], { cwd: WEB, stdio: 'pipe' });
    } catch (error) {
        throw new Error(String((error as { stdout?: Buffer }).stdout ?? error));
    } finally {
        rmSync(folder, { recursive: true });
    }
}, 60_000);

test('the core, with its reader, is at most 45 kB', () => {
    const sizes = Object.fromEntries(Object.keys(manifest.exports).map((entry) => [entry, gzipBytes(entry)]));
    if (process.env.LITETEX_FIGURES) console.log(sizes);
    expect(sizes['.']).toBeLessThanOrEqual(45_000);
    expect(sizes['./element']).toBeLessThanOrEqual(55_000);
});

test('the readers run in Node.js', async () => {
    const { readScene } = await import(pathToFileURL(join(WEB, manifest.exports['./read'].default)).href) as typeof import('../../src/core/read');
    for (const name of ['balanced.ltgs', 'balanced.glb', 'lossless.glb']) {
        // Small files are in the memory that Buffers share; this one stands behind other bytes.
        const bytes = Buffer.concat([Buffer.alloc(9), readFileSync(join(WEB, '../samples/conformance', name))]).subarray(9);
        const info = await readScene(bytes);
        expect([name, info.splats, info.cameras.length]).toEqual([name, 36, 3]);
    }
});
