/** Plays the program: serves the built page under its policy, a session, a scene and photos; and exports pages as files. */

import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { createServer, type IncomingMessage, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo, Socket } from 'node:net';
import { join } from 'node:path';
import { WEB } from './browser';

export const PAGE = join(WEB, '../exporters/page/view.html');
const TOKEN = '0123456789abcdef0123456789abcdef';

/** What the page may do, as in `exporters/src/html/page.rs`. */
export function policy(html: string, place: 'server' | 'file'): string {
    const hashes = (pattern: RegExp) => [...html.matchAll(pattern)].map(([, text]) => `'sha256-${createHash('sha256').update(text).digest('base64')}'`).join(' ');
    const script = hashes(/<script type="module">([\s\S]*?)<\/script>/g), style = hashes(/<style>([\s\S]*?)<\/style>/g);
    const rest = place === 'server' ? "connect-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'" : 'img-src blob: data:';
    return `default-src 'none'; script-src ${script}; style-src ${style}; worker-src blob:; ${rest}; base-uri 'none'; form-action 'none'`;
}

/** A page in one file with a scene inside, as `litetex export scene.html` writes it. */
export function exported(ltgs: Buffer, title: string): string {
    const html = readFileSync(PAGE, 'utf8');
    const meta = `<meta http-equiv="Content-Security-Policy" content="${policy(html, 'file')}">`;
    const session = JSON.stringify({ ...SESSION, title, asset: { ...SESSION.asset, url: null, bytes: ltgs.length } }).replace(/</g, '\\u003c');
    const data = `<script type="application/json" id="litetex-session">${session}</script>`
        + `<script type="application/vnd.litetex.ltgs;base64" id="litetex-asset">${ltgs.toString('base64')}</script>`;
    return html.replace('<meta charset="utf-8">', (all) => all + meta).replace('<body>', (all) => all + data);
}

export const SESSION = {
    schema: 'litetex-view/1', title: '', program: 'litetex 0.0.0',
    asset: { url: `/${TOKEN}/asset`, bytes: 0, format: 'ltgs', name: 'balanced.ltgs', revision: 1 },
    photos: null as { view: string; url: string; widthPx: number; heightPx: number }[] | null,
    training: null as object | null,
};
export type TestSession = Omit<typeof SESSION, 'asset'> & { asset: typeof SESSION.asset | null };

export class PageServer {
    session: TestSession = structuredClone(SESSION);
    asset: Buffer = Buffer.alloc(0);
    private readonly photos: Buffer[] = [];
    private readonly sockets = new Set<Socket>();
    private readonly server: Server = createServer((request, response) => this.answer(request, response));
    private port = 0;

    readonly assetUrl = SESSION.asset.url;
    /** Address of the page, with the token in its fragment. */
    get url(): string {
        return `${this.origin}/#${TOKEN}`;
    }

    get origin(): string {
        return `http://127.0.0.1:${this.port}`;
    }

    async start(): Promise<void> {
        this.server.on('connection', (socket) => {
            this.sockets.add(socket);
            socket.on('close', () => this.sockets.delete(socket));
        });
        await new Promise<void>((resolve) => this.server.listen(this.port, '127.0.0.1', resolve));
        this.port = (this.server.address() as AddressInfo).port;
    }

    async stop(): Promise<void> {
        for (const socket of this.sockets) socket.destroy();
        if (this.server.listening) await new Promise((resolve) => this.server.close(resolve));
    }

    addPhoto(view: string, png: Buffer): void {
        const [widthPx, heightPx] = [png.readUInt32BE(16), png.readUInt32BE(20)];
        (this.session.photos ??= []).push({ view, url: `/${TOKEN}/photo/${this.photos.push(png) - 1}`, widthPx, heightPx });
    }

    private answer(request: IncomingMessage, response: ServerResponse): void {
        const send = (type: string, body: string | Buffer, csp = "default-src 'none'; frame-ancestors 'none'") => response.writeHead(200, {
            'Content-Type': type, 'Content-Length': Buffer.byteLength(body), 'Cache-Control': 'no-store', 'Content-Security-Policy': csp, Connection: 'close',
            'X-Content-Type-Options': 'nosniff', 'Cross-Origin-Resource-Policy': 'same-origin', 'Cross-Origin-Opener-Policy': 'same-origin',
        }).end(body);
        const { pathname } = new URL(request.url!, 'http://localhost'); // as the program, which ignores queries
        const [, token, ...path] = pathname.split('/');
        const html = readFileSync(PAGE, 'utf8');
        if (pathname === '/') return void send('text/html; charset=utf-8', html, policy(html, 'server'));
        const what = token === TOKEN ? path.join('/') : '';
        const photo = this.photos[Number(/^photo\/(\d+)$/.exec(what)?.[1] ?? -1)];
        if (what === 'session.json') send('application/json', JSON.stringify(this.session));
        else if (what === 'asset') send('application/octet-stream', this.asset);
        else if (photo) send('image/png', photo);
        else response.writeHead(token === TOKEN ? 404 : 403).end();
    }
}
