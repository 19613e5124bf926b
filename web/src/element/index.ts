/**
 * `<litetex-viewer>`: shows a scene of textured splats.
 *
 * | attribute | meaning |
 * |---|---|
 * | `src` | address of a `.ltgs` or `.glb` file |
 * | `alt` | what the scene shows, for those who cannot see it |
 * | `camera-controls` | mouse, touch and keys move the camera |
 * | `controls-mode` | `orbit` (default) or `fly` |
 * | `disable-zoom` | wheel and pinch are left to the page |
 * | `auto-rotate` | turns around the scene until someone takes hold of it, and once more when set again; not for those who prefer reduced motion |
 * | `rotation-per-second` | degrees; default 12 |
 * | `view` | name of the camera to begin at; default: the home view |
 * | `background` | `#rrggbb`, `transparent`, or `scene` (default): that of the file |
 * | `colours` | `trained` (default), `untextured`, `texels`, `degree`, `depth` |
 * | `max-splats` | shows at most this many, those that contribute most |
 * | `loading` | `eager` (default) or `lazy`: once it is visible |
 *
 * Events: `load`; `progress` (a ProgressEvent: `loaded` and `total` bytes); `error` (an ErrorEvent: `message`, `error`); `camera-change`.
 * Slots: `poster`, shown until there is an image; the default slot lies over the scene.
 *
 * Elements share six WebGL contexts. Those that have none show their last image, and get one when they become visible or are used:
 * from others that are not visible, else from the one used longest ago.
 */

import { COLOURS, type Colours } from '../core/render/colours';
import type { SplatRenderer } from '../core/render/renderer';
import type { SceneInfo } from '../core/scene';
import { type Source, stored } from '../core/worker/messages';
import { type FrameFigures, Viewer } from '../viewer/viewer';
import { join, leave, settle, use } from './contexts';

const STYLE = `
:host { display: block; position: relative; min-height: 8em; contain: content; }
:host([hidden]) { display: none; }
canvas { display: block; width: 100%; height: 100%; position: absolute; inset: 0; outline-offset: -2px; object-fit: contain; }
.still { pointer-events: none; }
.still[hidden] { display: none; }
:has(+ .still:not([hidden])) { opacity: 0; }
progress { position: absolute; inset: auto 0 0 0; width: 100%; height: 3px; appearance: none; border: 0; background: transparent; }
progress::-webkit-progress-bar { background: transparent; }
progress::-webkit-progress-value, progress::-moz-progress-bar { background: currentColor; }
progress[hidden] { display: none; }
[part=error] { position: absolute; inset: 0; display: grid; place-items: center; padding: 1em; text-align: center; }
[part=error]:empty, slot[hidden] { display: none; }
`;

const ATTRIBUTES = ['src', 'alt', 'camera-controls', 'controls-mode', 'disable-zoom', 'auto-rotate', 'rotation-per-second', 'view', 'background', 'colours', 'max-splats', 'loading'];

/** Servers that render pages have no HTMLElement; they may import this all the same. */
const Base: typeof HTMLElement = globalThis.HTMLElement ?? (class {} as unknown as typeof HTMLElement);

/** Who prefers it gets no motion that goes on by itself. */
const reducedMotion = globalThis.matchMedia?.('(prefers-reduced-motion: reduce)');

export class LitetexViewerElement extends Base {
    static readonly observedAttributes = ATTRIBUTES;
    private viewer: Viewer | null = null;
    private readonly canvas = document.createElement('canvas');
    /** The last image, while there is no context. */
    private readonly still = document.createElement('canvas');
    private readonly bar = document.createElement('progress');
    private readonly failure = document.createElement('div');
    private readonly poster = document.createElement('slot');
    private readonly visibility = new IntersectionObserver((entries) => this.seen(entries[entries.length - 1].isIntersecting));
    /** What is to be shown, whether it has arrived as a whole, and whether it cannot be shown. */
    private source: Source | null = null;
    private hasLoaded = false;
    private hasFailed = false;
    /** An image of the whole scene is there, drawn or still; it is that of now. */
    private hasImage = false;
    private isCurrent = false;
    private isVisible = false;
    private isWanted = false;
    /** Someone has taken hold of the scene, which then turns no longer by itself. */
    private isHeld = false;
    /** It stands elsewhere in the document, where its scene has not been shown yet. */
    private hasMoved = false;
    private readonly share = { wish: () => this.wish(), hold: () => this.hold(), take: () => this.take(), give: () => this.give() };

    constructor() {
        super();
        const root = this.attachShadow({ mode: 'open' });
        const sheet = new CSSStyleSheet(); // allowed by any Content-Security-Policy, unlike <style>
        sheet.replaceSync(STYLE);
        root.adoptedStyleSheets = [sheet];
        this.poster.name = 'poster';
        this.bar.hidden = true;
        this.bar.part.add('progress');
        this.failure.part.add('error');
        this.failure.setAttribute('role', 'alert');
        for (const canvas of [this.canvas, this.still]) canvas.part.add('canvas');
        this.still.className = 'still';
        this.still.hidden = true;
        root.append(this.canvas, this.still, this.poster, this.bar, this.failure, document.createElement('slot'));
    }

    connectedCallback(): void {
        this.canvas.setAttribute('role', 'img');
        this.isWanted ||= this.getAttribute('loading') !== 'lazy';
        this.hasMoved = this.hasLoaded;
        this.visibility.observe(this);
        reducedMotion?.addEventListener('change', this.turn);
        join(this.share);
    }

    disconnectedCallback(): void {
        this.visibility.disconnect();
        reducedMotion?.removeEventListener('change', this.turn);
        this.isVisible = false;
        leave(this.share);
    }

    attributeChangedCallback(name: string, before: string | null, now: string | null): void {
        if (name === 'auto-rotate') this.isHeld = false;
        if (name === 'src' && before !== now) this.load(now ? { url: now } : null);
        if (name === 'max-splats' && before !== now && this.source) this.load(this.source);
        if (name === 'loading') this.isWanted ||= this.isConnected && now !== 'lazy';
        if (name === 'colours' || name === 'background') this.isCurrent = false;
        if (this.viewer) this.update();
        settle();
    }

    /** What the file says; null until its header is there. */
    get info(): SceneInfo | null {
        return this.viewer?.info ?? null;
    }

    /** Splats and texels shown, their bytes on the GPU, and milliseconds of the last sort; null until they are there. */
    get figures(): SplatRenderer['figures'] | null {
        return this.viewer?.renderer.figures ?? null;
    }

    get src(): string {
        return this.getAttribute('src') ?? '';
    }

    set src(address: string) {
        this.setAttribute('src', address);
    }

    /** Takes exactly the view of a camera of the file. Returns whether there is one of this name. */
    goTo(name: string): boolean {
        const camera = this.info?.cameras.find((candidate) => candidate.name === name);
        if (camera) this.viewer!.goTo(camera);
        this.use();
        return Boolean(camera);
    }

    /** Goes back to where it began. */
    home(): void {
        this.viewer?.home();
        this.use();
    }

    /** A PNG image of what is shown. */
    async toBlob(): Promise<Blob> {
        if (!this.viewer) throw new Error('nothing is shown yet');
        if (this.still.hidden) return this.viewer.screenshot();
        const blob = await new Promise<Blob | null>((resolve) => this.still.toBlob(resolve));
        if (!blob) throw new Error('the browser makes no image');
        return blob;
    }

    /** Shows the bytes of a file instead of `src`. They are copied. */
    show(bytes: ArrayBuffer | Uint8Array): void {
        this.isWanted = true;
        this.load(stored({ bytes }));
    }

    /** How much it wants a context: most to show what is visible and was never shown, less to move what is still, least to load what is not visible. */
    private wish(): number {
        if (!this.source || this.hasFailed || !this.isWanted) return 0;
        const isDue = !this.hasImage || !this.isCurrent || this.hasMoved;
        if (this.isVisible) return isDue ? 3 : 2;
        return isDue ? 1 : 0;
    }

    /** How much it needs the context that it has. */
    private hold(): number {
        const isDone = !this.source || this.hasFailed || (this.hasImage && this.still.hidden);
        if (!this.isVisible) return isDone ? 0 : 1;
        if (!isDone || this.viewer?.controls.active) return 3;
        return this.viewer?.autoRotate ? 2.5 : 2;
    }

    private load(source: Source | null): void {
        this.source = source;
        this.hasLoaded = this.hasImage = this.hasFailed = this.hasMoved = false;
        this.failure.textContent = '';
        this.poster.hidden = false;
        if (this.viewer) this.open();
        settle();
    }

    private open(): void {
        if (!this.source) return;
        try {
            this.viewer!.maxSplats = this.maxSplats;
            this.viewer!.open(this.source);
        } catch (error) {
            this.failed(error as Error); // not an address
        }
    }

    /** Takes a context. */
    private take(): void {
        if (this.viewer) return this.viewer.wake();
        try {
            this.viewer = new Viewer(this.canvas, {
                info: () => this.begun(),
                progress: (bytes) => this.progressed(bytes),
                load: () => this.loaded(),
                error: (error) => this.failed(error),
                camera: () => this.dispatchEvent(new Event('camera-change')),
                held: () => this.held(),
                drawn: (frame) => this.drawn(frame),
                lost: () => this.lost(),
                restored: () => { this.failure.textContent = ''; },
            }, this);
        } catch (error) {
            return this.failed(error as Error);
        }
        this.canvas.addEventListener('pointerdown', () => this.held());
        this.canvas.addEventListener('focus', () => this.use());
        this.update();
        this.open();
    }

    /** The browser has taken it away, and restores it when it likes. */
    private lost(): void {
        this.hasImage = false;
        this.failure.textContent = 'The graphics driver has stopped, or the rest of the page draws too much.';
    }

    /** Gives it up, and goes on showing the last image. */
    private give(): void {
        if (!this.viewer?.rest(this.still)) return;
        this.still.hidden = false;
        this.isCurrent = true;
    }

    private seen(isVisible: boolean): void {
        this.isVisible = isVisible;
        this.isWanted ||= isVisible;
        this.turn();
        settle();
    }

    private held(): void {
        this.isHeld = true;
        this.turn();
        this.use();
    }

    /** What is shown changes: with a still image, that takes a context. */
    private use(): void {
        this.isCurrent = false;
        use(this.share);
    }

    /** Turns by itself, or not. */
    private readonly turn = (): void => {
        const { viewer } = this;
        if (!viewer) return;
        const degrees = Number(this.getAttribute('rotation-per-second') ?? 12);
        const turns = this.hasAttribute('auto-rotate') && !this.isHeld && this.isVisible && !reducedMotion?.matches;
        viewer.autoRotate = turns ? degrees * Math.PI / 180 : 0;
        viewer.invalidate();
    };

    private get maxSplats(): number {
        const most = Math.floor(Number(this.getAttribute('max-splats')));
        return most >= 1 ? most : Infinity;
    }

    private update(): void {
        const viewer = this.viewer!;
        const controls = this.hasAttribute('camera-controls');
        viewer.controls.enabled = controls;
        viewer.controls.zoom = !this.hasAttribute('disable-zoom');
        viewer.controls.mode = this.getAttribute('controls-mode') === 'fly' ? 'fly' : 'orbit';
        this.canvas.tabIndex = controls ? 0 : -1;
        this.canvas.style.touchAction = controls ? 'none' : 'auto';
        this.canvas.setAttribute('aria-label', this.getAttribute('alt') ?? 'A scene of splats');
        const colours = this.getAttribute('colours') ?? 'trained';
        viewer.colours = colours in COLOURS ? colours as Colours : 'trained';
        viewer.background = backgroundOf(this.getAttribute('background') ?? 'scene');
        this.turn();
    }

    private begun(): void {
        this.still.hidden = true; // that of another scene
        const name = this.getAttribute('view');
        if (name && this.viewer!.pose) this.goTo(name);
    }

    private loaded(): void {
        this.hasLoaded = true;
        this.bar.hidden = true;
        this.dispatchEvent(new Event('load'));
    }

    private drawn({ complete }: FrameFigures): void {
        if (!complete) return;
        this.isCurrent = true;
        if (this.hasImage && this.still.hidden && !this.hasMoved) return;
        this.still.hidden = this.hasImage = true;
        if (this.hasMoved) this.dispatchEvent(new Event('load'));
        this.hasMoved = false;
        settle();
    }

    private progressed(bytes: number): void {
        const totalBytes = this.info!.fileBytes;
        this.poster.hidden = true;
        this.bar.hidden = false;
        this.bar.max = totalBytes;
        this.bar.value = bytes;
        this.dispatchEvent(new ProgressEvent('progress', { lengthComputable: true, loaded: bytes, total: totalBytes }));
    }

    private failed(error: Error): void {
        this.bar.hidden = true;
        this.hasFailed = true;
        this.failure.textContent = error.message;
        settle();
        this.dispatchEvent(new ErrorEvent('error', { message: error.message, error }));
    }
}

/** Undefined: that of the scene. */
function backgroundOf(text: string): readonly [number, number, number] | null | undefined {
    if (text === 'transparent') return null;
    const digits = /^#([0-9a-f]{6})$/i.exec(text)?.[1];
    return digits ? [0, 2, 4].map((at) => parseInt(digits.slice(at, at + 2), 16) / 255) as [number, number, number] : undefined;
}

if (globalThis.customElements && !customElements.get('litetex-viewer')) customElements.define('litetex-viewer', LitetexViewerElement);

declare global {
    interface HTMLElementTagNameMap {
        'litetex-viewer': LitetexViewerElement;
    }
}
