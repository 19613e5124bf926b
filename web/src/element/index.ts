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
 * | `view` | name of the camera to begin at, whose image is shown whole; default: the home view, whose image covers the element |
 * | `keep-near` | keeps the camera where photos were taken: within this part of their cameras' spread of one of them; without a number 0.3 |
 * | `background` | `#rrggbb`, `transparent`, or `scene` (default): that of the file |
 * | `colours` | `trained` (default), `untextured`, `texels`, `degree`, `depth` |
 * | `max-splats` | shows at most this many, those that contribute most |
 * | `precision` | `auto` (default): fast while the camera moves, exact at rest where an image takes less than 100 ms; `exact` or `fast`: always |
 * | `loading` | `eager` (default) or `lazy`: once it is visible |
 *
 * Attributes that are on or off are off with the value `false`, too, which frameworks write. Types of all: markup.ts.
 *
 * Events: `load`; `progress` (a ProgressEvent: `loaded` and `total` bytes); `error` (an ErrorEvent: `message`, `error`); `camera-change`.
 * Slots: `poster`, shown until there is an image; the default slot lies over the scene.
 *
 * Elements share six WebGL contexts. Those that have none show their last image, and get one when they become visible or are used:
 * from others that are not visible, else from the one used longest ago.
 */

import type { SplatRenderer } from '../core/render/renderer';
import type { SceneInfo } from '../core/scene';
import { type Source, stored } from '../core/worker/messages';
import { reducedMotion } from '../viewer/motion';
import { type FrameFigures, Viewer } from '../viewer/viewer';
import { ATTRIBUTES, backgroundOf, coloursOf, isOn, maxSplatsOf, precisionOf, reachOf, rotationOf } from './attributes';
import { join, leave, settle, use } from './contexts';
import { Parts } from './parts';

/** Servers that render pages have no HTMLElement; they may import this all the same. */
const Base: typeof HTMLElement = globalThis.HTMLElement ?? (class {} as unknown as typeof HTMLElement);

export class LitetexViewerElement extends Base {
    static readonly observedAttributes = ATTRIBUTES;
    private viewer: Viewer | null = null;
    private readonly parts: Parts;
    private readonly visibility = new IntersectionObserver((entries) => this.seen(entries[entries.length - 1].isIntersecting));
    private readonly size = new ResizeObserver(() => this.sized());
    /** What is to be shown, whether it has arrived as a whole, and whether it cannot be shown. */
    private source: Source | null = null;
    private hasLoaded = false;
    private hasFailed = false;
    /** An image of the whole scene is there, drawn or still; it is that of now. */
    private hasImage = false;
    private isCurrent = false;
    /** It lies in the window; it has an area there, without which nothing is drawn. */
    private isInWindow = false;
    private hasArea = false;
    private isWanted = false;
    /** Someone has taken hold of the scene, which then turns no longer by itself. */
    private isHeld = false;
    /** It stands elsewhere in the document, where its scene has not been shown yet. */
    private hasMoved = false;
    private readonly share = { wish: () => this.wish(), hold: () => this.hold(), take: () => this.take(), give: () => this.give() };

    constructor() {
        super();
        this.parts = new Parts(this);
    }

    connectedCallback(): void {
        this.parts.canvas.setAttribute('role', 'img');
        this.isWanted ||= this.getAttribute('loading') !== 'lazy';
        this.hasMoved = this.hasLoaded;
        this.visibility.observe(this);
        this.size.observe(this);
        reducedMotion?.addEventListener('change', this.turn);
        join(this.share);
    }

    disconnectedCallback(): void {
        this.visibility.disconnect();
        this.size.disconnect();
        reducedMotion?.removeEventListener('change', this.turn);
        this.isInWindow = this.hasArea = false;
        leave(this.share);
    }

    attributeChangedCallback(name: string, before: string | null, now: string | null): void {
        if (name === 'auto-rotate') this.isHeld = false;
        if (name === 'src' && (before !== now || this.hasFailed)) this.load(now ? { url: now } : null);
        if (name === 'max-splats' && before !== now && this.source) this.load(this.source);
        if (name === 'loading') this.isWanted ||= this.isConnected && now !== 'lazy';
        if (name === 'colours' || name === 'background' || name === 'precision') this.isCurrent = false;
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

    /** Without an address nothing is shown: so React takes `src` away. */
    set src(address: string | null | undefined) {
        if (address == null) this.removeAttribute('src');
        else this.setAttribute('src', address);
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

    /**
     * Turns to the surface that is shown at a place of the element, CSS px from its upper left corner, as a double click does: orbits go
     * around it from then on. Resolves to whether there is one.
     */
    async focusOn(x: number, y: number): Promise<boolean> {
        this.use();
        return this.viewer?.focusOn(x, y) ?? false;
    }

    /** A PNG image of what is shown. */
    async toBlob(): Promise<Blob> {
        if (!this.viewer) throw new Error('nothing is shown yet');
        return this.parts.still.hidden ? this.viewer.screenshot() : this.parts.stillBlob();
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
        return isDue && !this.isReadUnseen ? 1 : 0;
    }

    /** How much it needs the context that it has. */
    private hold(): number {
        const isDone = !this.source || this.hasFailed || (this.hasImage && this.parts.still.hidden) || this.isReadUnseen;
        if (!this.isVisible) return isDone ? 0 : 1;
        if (!isDone || this.viewer?.controls.active) return 3;
        return this.viewer?.autoRotate ? 2.5 : 2;
    }

    private get isVisible(): boolean {
        return this.isInWindow && this.hasArea;
    }

    /** There is nothing more to do until it has an area to draw on. */
    private get isReadUnseen(): boolean {
        return this.hasLoaded && !this.hasArea;
    }

    private load(source: Source | null): void {
        this.source = source;
        this.hasLoaded = this.hasImage = this.hasFailed = this.hasMoved = false;
        this.parts.clear();
        if (!source) {
            this.parts.still.hidden = true;
            this.viewer?.clear();
        }
        if (this.viewer) this.open();
        else if (this.isConnected) this.retry();
        settle();
    }

    /** Where no context could be had, one may be there now. */
    private retry(): void {
        leave(this.share);
        join(this.share);
    }

    private open(): void {
        if (!this.source) return;
        try {
            this.viewer!.maxSplats = maxSplatsOf(this);
            this.viewer!.open(this.source);
        } catch (error) {
            this.failed(error as Error); // not an address
        }
    }

    /** Takes a context. */
    private take(): void {
        if (this.viewer) return this.viewer.wake();
        try {
            this.viewer = new Viewer(this.parts.canvas, {
                info: () => this.begun(),
                progress: (bytes) => this.progressed(bytes),
                load: () => this.loaded(),
                error: (error) => this.failed(error),
                camera: () => this.dispatchEvent(new Event('camera-change')),
                held: () => this.held(),
                drawn: (frame) => this.drawn(frame),
                lost: () => this.lost(),
                restored: () => this.restored(),
            }, this);
        } catch (error) {
            return this.failed(error as Error);
        }
        this.parts.canvas.addEventListener('pointerdown', () => this.held());
        this.parts.canvas.addEventListener('focus', () => this.use());
        this.update();
        this.open();
    }

    /** The browser has taken it away, and restores it when it likes. */
    private lost(): void {
        this.hasImage = false;
        if (!this.hasFailed) this.parts.failure.textContent = 'The graphics driver has stopped, or the rest of the page draws too much.';
    }

    private restored(): void {
        if (!this.hasFailed) this.parts.failure.textContent = '';
    }

    /** Gives it up, and goes on showing the last image. */
    private give(): void {
        if (!this.viewer?.rest(this.parts.still)) return;
        this.parts.still.hidden = false;
        this.isCurrent = true;
    }

    private seen(isInWindow: boolean): void {
        this.isInWindow = isInWindow;
        this.isWanted ||= isInWindow;
        this.turn();
        settle();
    }

    private sized(): void {
        this.hasArea = this.clientWidth > 0 && this.clientHeight > 0;
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
        const turns = isOn(this, 'auto-rotate') && !this.isHeld && this.isVisible && !reducedMotion?.matches;
        viewer.autoRotate = turns ? rotationOf(this) : 0;
        viewer.invalidate();
    };

    private update(): void {
        const viewer = this.viewer!;
        const controls = isOn(this, 'camera-controls');
        viewer.controls.enabled = controls;
        viewer.controls.zoom = !isOn(this, 'disable-zoom');
        viewer.controls.mode = this.getAttribute('controls-mode') === 'fly' ? 'fly' : 'orbit';
        this.parts.canvas.tabIndex = controls ? 0 : -1;
        this.parts.canvas.style.touchAction = controls ? 'none' : 'auto';
        this.parts.canvas.setAttribute('aria-label', this.getAttribute('alt') ?? 'A scene of splats');
        viewer.colours = coloursOf(this);
        viewer.background = backgroundOf(this);
        viewer.precision = precisionOf(this);
        viewer.reach = isOn(this, 'keep-near') ? reachOf(this) : Infinity;
        this.turn();
    }

    private begun(): void {
        this.parts.still.hidden = true; // that of another scene
        const name = this.getAttribute('view');
        if (name && this.viewer!.pose) this.goTo(name);
    }

    private loaded(): void {
        this.hasLoaded = true;
        this.parts.bar.hidden = true;
        settle();
        this.dispatchEvent(new Event('load'));
    }

    private drawn({ complete }: FrameFigures): void {
        if (!complete) return;
        this.isCurrent = true;
        if (this.hasImage && this.parts.still.hidden && !this.hasMoved) return;
        this.parts.still.hidden = this.hasImage = true;
        if (this.hasMoved) this.dispatchEvent(new Event('load'));
        this.hasMoved = false;
        settle();
    }

    private progressed(bytes: number): void {
        const totalBytes = this.info!.fileBytes;
        this.parts.showProgress(bytes, totalBytes);
        this.dispatchEvent(new ProgressEvent('progress', { lengthComputable: true, loaded: bytes, total: totalBytes }));
    }

    private failed(error: Error): void {
        this.parts.bar.hidden = true;
        this.hasFailed = true;
        this.parts.failure.textContent = error.message;
        settle();
        this.dispatchEvent(new ErrorEvent('error', { message: error.message, error }));
    }
}

if (globalThis.customElements && !customElements.get('litetex-viewer')) customElements.define('litetex-viewer', LitetexViewerElement);

declare global {
    interface HTMLElementTagNameMap {
        'litetex-viewer': LitetexViewerElement;
    }
}
