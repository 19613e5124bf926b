/** The page as it is committed. */

import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, describe, expect, test } from 'vitest';
import { build } from 'vite';

const WEB = join(import.meta.dirname, '../..');
const html = readFileSync(join(WEB, '../exporters/page/view.html'), 'utf8');
const outDir = mkdtempSync(join(tmpdir(), 'page-'));
afterAll(() => rmSync(outDir, { recursive: true }));

describe('exporters/page/view.html', () => {
    test('is what the sources give; else run "npm run build:page"', async () => {
        await build({ root: join(WEB, 'src/page'), configFile: join(WEB, 'vite.page.config.ts'), logLevel: 'error', build: { outDir } });
        expect(readFileSync(join(outDir, 'view.html'), 'utf8') === html).toBe(true);
    }, 60_000);

    test('has one script, one style, and refers to nothing outside', () => {
        const scripts = html.match(/<script[^>]*>/gi), styles = html.match(/<style[^>]*>/gi);
        expect(scripts).toEqual(['<script type="module">']);
        expect(styles).toEqual(['<style>']);
        const markup = html.replace(/<script[\s\S]*<\/script>|<style>[\s\S]*<\/style>/g, '');
        expect([...markup.matchAll(/\b(?:src|href|action|srcset)="([^"]*)"/g)].map(([, value]) => value)).toEqual(['data:,']);
        expect(markup).not.toMatch(/\s(style|on\w+)=/i);
        expect(html).not.toMatch(/@import|url\(|\beval\(|new Function|innerHTML|insertAdjacentHTML|document\.write/);
        expect([...html.matchAll(/https?:\/\/[\w.]+/g)].map(([address]) => address).filter((address) => address !== 'http://www.w3.org')).toEqual([]);
    });

    test('begins as the program expects it, and is small', () => {
        expect(html).toMatch(/^<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">/);
        const at = (part: string) => html.indexOf(part);
        expect(at('<title>')).toBeGreaterThan(0);
        expect(at('<body>')).toBeGreaterThan(at('</title>'));
        expect(html.match(/<body>|<title>|<\/body>/g)).toHaveLength(3);
        expect(Buffer.byteLength(html)).toBeLessThan(175_000);
    });
});
