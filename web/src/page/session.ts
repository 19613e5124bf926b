/** What the page is told about its scene: by the program that serves it, or inside an exported file. */

export interface SessionAsset {
    /** Null if its bytes are in the page. */
    readonly url: string | null;
    readonly bytes: number;
    readonly format: string;
    readonly name: string;
    /** Grows with each change of the scene. */
    readonly revision: number;
}

export interface SessionPhoto {
    /** Name of the camera that took it. */
    readonly view: string;
    readonly url: string;
    readonly widthPx: number;
    readonly heightPx: number;
}

export interface SessionTraining {
    readonly step: number;
    readonly steps: number;
    readonly etaSecs: number | null;
    readonly splats: number;
    readonly texels: number;
    readonly curve: readonly (readonly [step: number, value: number])[];
    /** `psnr`, of the test views, or `loss`. */
    readonly curveOf?: string;
    readonly state: 'running' | 'finished' | 'stopped';
}

export interface Session {
    readonly schema: string;
    readonly title: string;
    readonly program: string;
    readonly asset: SessionAsset | null;
    readonly photos: readonly SessionPhoto[] | null;
    readonly training: SessionTraining | null;
}

export interface SessionEvents {
    session(session: Session, base: URL): void;
    /** The program does not answer any more. */
    lost(): void;
    /** The program does not know the page's token. It is asked no more. */
    refused(): void;
    /** The page belongs to no program. */
    none(): void;
}

class Refused extends Error {}

const SCHEMA = 'litetex-view/1';
const RUNNING_MS = 1000;
const IDLE_MS = 3000;
const TIMEOUT_MS = 10_000;

/** The scene inside the page, if it has one. Its text is dropped, which halves what the page needs. */
export function embedded(): { bytes: ArrayBuffer; session: Session | null } | null {
    const asset = document.getElementById('litetex-asset');
    if (!asset) return null;
    const text = document.getElementById('litetex-session')?.textContent;
    const bytes = decodeBase64(asset.textContent!.trim());
    asset.remove();
    return { bytes, session: text ? JSON.parse(text) as Session : null };
}

/** Where the session of a served page is: the fragment is a token that leads there; else beside the page. Null for files. */
export function sessionUrl(page: URL): URL | null {
    if (!/^https?:$/.test(page.protocol)) return null;
    const token = page.hash.slice(1);
    return new URL(/^[\w-]+$/.test(token) ? `/${token}/session.json` : 'session.json', page);
}

/** Asks for the session again and again. */
export function watch(url: URL, events: SessionEvents): void {
    let answered = false, failures = 0;
    const ask = async (): Promise<void> => {
        await visible();
        let pause = RUNNING_MS;
        try {
            const session = await fetchSession(url);
            answered = true;
            failures = 0;
            events.session(session, url);
            if (session.training?.state !== 'running') pause = IDLE_MS;
        } catch (error) {
            if (!answered && !location.hash) return events.none();
            if (error instanceof Refused) return events.refused();
            // Two in a row: one may be lost while the computer sleeps.
            if (++failures === 2) events.lost();
        }
        setTimeout(ask, pause);
    };
    void ask();
}

/** Resolves when someone can see the page: the program makes scenes of a training only while it is asked. */
function visible(): Promise<void> {
    if (!document.hidden) return Promise.resolve();
    return new Promise((resolve) => document.addEventListener('visibilitychange', () => resolve(), { once: true }));
}

async function fetchSession(url: URL): Promise<Session> {
    const response = await fetch(url, { cache: 'no-store', signal: AbortSignal.timeout(TIMEOUT_MS) });
    if (response.status === 403) throw new Refused();
    if (!response.ok) throw new Error(response.statusText);
    const session = await response.json() as Session;
    if (session.schema !== SCHEMA) throw new Error(`schema ${session.schema}`);
    return session;
}

function decodeBase64(text: string): ArrayBuffer {
    const binary = atob(text);
    const bytes = new Uint8Array(binary.length);
    for (let i = 0; i < binary.length; i++) bytes[i] = binary.charCodeAt(i);
    return bytes.buffer;
}
