/** Asks for files, and says what to do if they do not come. */

/** Rejects with an error that names the address and the remedy. */
export async function fetchFile(url: string, init?: RequestInit): Promise<Response> {
    const response = await fetch(url, init).catch((error: Error) => {
        throw error.name === 'AbortError' ? error : new Error(`${url}: ${remedyFor(url)} (the browser says: ${error.message})`, { cause: error });
    });
    if (response.ok && response.body) return response;
    throw new Error(`${url}: the server answers ${`${response.status} ${response.statusText}`.trim()}${response.status === 404 ? '; is the address right?' : ''}`);
}

/** Browsers do not tell scripts why a request has failed: what can be said by the addresses of the file and of the page. */
function remedyFor(url: string): string {
    const { origin: page } = globalThis;
    const { protocol, origin } = new URL(url);
    if (globalThis.navigator?.onLine === false) return 'this device is offline';
    if (protocol === 'file:') return 'browsers fetch nothing from the disk; serve the folder over http, or give the bytes of the file instead of an address';
    if (!/^(https?|blob|data):$/.test(protocol)) return `browsers fetch nothing from ${protocol}; expected an address that begins with https: or http:`;
    if (page?.startsWith('https:') && protocol === 'http:' && !isLocal(url)) return 'a page served over https may not fetch over http; use an address that begins with https:';
    if (origin === page) return 'the server does not answer; does it run, and does the Content-Security-Policy of the page allow its own address in connect-src?';
    return `the server does not answer, or does not allow pages of ${page} to read from it: it must send the header Access-Control-Allow-Origin: ${page === 'null' ? '*' : page}`
        + ', and a Content-Security-Policy of the page must allow its address in connect-src';
}

function isLocal(url: string): boolean {
    return /^(localhost|127\.|\[::1\])/.test(new URL(url).hostname);
}

/** The bytes of an answer as they arrive; each piece is also given to `keep`. Fails with an error that names the address. */
export function streamOf({ body }: Response, url: string, keep: (piece: Uint8Array<ArrayBuffer>) => void): ReadableStream<Uint8Array> {
    const reader = body!.getReader();
    let bytes = 0;
    return new ReadableStream({
        async pull(controller) {
            const { value, done } = await reader.read().catch((error: Error) => {
                throw new Error(`${url}: the connection broke after ${bytes} bytes; load it again (the browser says: ${error.message})`, { cause: error });
            });
            if (done) return controller.close();
            bytes += value.length;
            keep(value);
            controller.enqueue(value);
        },
        cancel: (reason) => reader.cancel(reason),
    }, { highWaterMark: 0 });
}
