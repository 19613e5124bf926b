import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { defineConfig, type Plugin } from 'vite';
import { glsl } from './vite.glsl';

const ROOT = fileURLToPath(new URL('./src/page', import.meta.url));
const BUILT = fileURLToPath(new URL('../exporters/page', import.meta.url));

/**
 * Puts script and style into the page, which then is one file: `view.html`. It keeps what the program relies on: the charset
 * stands first, then the title, then the body; nothing in the script looks like a tag that begins or ends one.
 */
const oneFile: Plugin = {
    name: 'one-file',
    enforce: 'post',
    generateBundle(_, bundle) {
        let [script, style] = ['', ''];
        for (const [name, part] of Object.entries(bundle)) {
            if (part.type === 'chunk') script += part.code.trim();
            else if (name.endsWith('.css')) style += String(part.source).trim();
            delete bundle[name];
        }
        const html = readFileSync(join(ROOT, 'index.html'), 'utf8')
            .replace(/\n\s*(?=<)/g, '\n')
            .replace(/<link rel="stylesheet"[^>]*>/, () => `<style>${style}</style>`)
            .replace(/<script type="module"[^>]*>/, () => `<script type="module">${script.replace(/<(\/?script|!--)/gi, '\\x3c$1')}`);
        this.emitFile({ type: 'asset', fileName: 'view.html', source: html });
    },
};

// The page that the program embeds. The same sources and packages give the same bytes.
export default defineConfig({
    root: ROOT,
    base: './',
    plugins: [glsl(), oneFile],
    build: {
        target: 'es2022', cssTarget: ['chrome123', 'firefox128', 'safari18'], minify: 'oxc', modulePreload: false,
        outDir: BUILT, emptyOutDir: true, reportCompressedSize: false,
    },
});
