/** Chromium with its software driver, and a server of the package's sources. */

import { chromium, type Browser, type Page } from 'playwright-core';
import { existsSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { createServer, type ViteDevServer } from 'vite';

const BROWSERS = ['chromium', 'chromium-browser', 'google-chrome'].flatMap((name) => ['/usr/bin', '/usr/local/bin'].map((folder) => `${folder}/${name}`));
export const FLAGS = ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update',
    '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

/** WebGPU on the software driver, too; nothing of it is ever shown on a canvas. */
export const WEBGPU_FLAGS = ['--enable-unsafe-webgpu', '--use-webgpu-adapter=swiftshader', '--use-vulkan=swiftshader', '--enable-features=Vulkan,WebGPU'];

export const WEB = fileURLToPath(new URL('../..', import.meta.url));

/** The browser's program, or null: then the tests are skipped, unless LITETEX_REQUIRE_BROWSER is set. */
export function browserPath(): string | null {
    const path = process.env.CHROMIUM ?? BROWSERS.find((candidate) => existsSync(candidate)) ?? null;
    if (!path && process.env.LITETEX_REQUIRE_BROWSER) throw new Error('no Chromium is installed, and LITETEX_REQUIRE_BROWSER is set');
    return path;
}

export class BrowserTest {
    /** Errors that the page's console has shown. */
    readonly errors: string[] = [];
    private constructor(readonly browser: Browser, readonly server: ViteDevServer, readonly page: Page, readonly url: string) {}

    /** Opens a page of `tests/browser`, where `init` runs first; files of `folders` can be fetched by their absolute paths as `/@fs/PATH`. */
    static async open(path: string, folders: readonly string[] = [], init: () => void = () => {}, flags: readonly string[] = []): Promise<BrowserTest> {
        const server = await createServer({
            root: WEB, configFile: false, logLevel: 'error', server: { port: 0, host: '127.0.0.1', fs: { allow: [WEB, ...folders] }, hmr: false, watch: null },
            optimizeDeps: { noDiscovery: true },
            // One file instead of a thousand: the build that checks what it is given.
            resolve: { alias: { playcanvas: 'playcanvas/build/playcanvas.dbg.mjs' } },
        });
        await server.listen();
        const url = server.resolvedUrls!.local[0];
        const browser = await chromium.launch({ executablePath: browserPath()!, headless: true, args: [...FLAGS, ...flags] });
        const page = await browser.newPage();
        const test = new BrowserTest(browser, server, page, url);
        page.on('console', (message) => { if (message.type() === 'error') test.errors.push(message.text()); });
        page.on('pageerror', (error) => test.errors.push(String(error)));
        await page.addInitScript(init);
        await page.goto(url + path);
        await page.waitForFunction(() => 'ready' in window).catch((error) => { throw new Error(`${path}: ${test.errors.join('; ') || error}`); });
        return test;
    }

    async close(): Promise<void> {
        await this.browser.close();
        await this.server.close();
    }
}
