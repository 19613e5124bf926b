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
 * | `auto-rotate` | turns around the scene until someone takes hold of it |
 * | `rotation-per-second` | degrees; default 12 |
 * | `view` | name of the camera to begin at; default: the home view |
 * | `background` | `#rrggbb`, `transparent`, or `scene` (default): that of the file |
 * | `colours` | `trained` (default), `untextured`, `texels`, `degree`, `depth` |
 * | `max-splats` | shows at most this many, those that contribute most |
 * | `loading` | `eager` (default) or `lazy`: once it comes into sight |
 *
 * Events: `load`; `progress` (a ProgressEvent: `loaded` and `total` bytes); `error` (an ErrorEvent: `message`, `error`); `camera-change`.
 * Slots: `poster`, shown until there is an image; the default slot lies over the scene.
 */

import { COLOURS, type Colours } from '../core/render/colours';
import type { SplatRenderer } from '../core/render/renderer';
import type { SceneInfo } from '../core/scene';
import { Viewer } from '../viewer/viewer';

const STYLE = `
:host { display: block; position: relative; min-height: 8em; contain: content; }
:host([hidden]) { display: none; }
canvas { display: block; width: 100%; height: 100%; position: absolute; inset: 0; outline-offset: -2px; }
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

export class LitetexViewerElement extends Base {
    static readonly observedAttributes = ATTRIBUTES;
    private viewer: Viewer | null = null;
    private canvas = document.createElement('canvas');
    private readonly bar = document.createElement('progress');
    private readonly failure = document.createElement('div');
    private readonly poster = document.createElement('slot');
    private sight: IntersectionObserver | null = null;
    private shown = '';

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
        this.canvas.part.add('canvas');
        root.append(this.canvas, this.poster, this.bar, this.failure, document.createElement('slot'));
    }

    connectedCallback(): void {
        this.canvas.setAttribute('role', 'img');
        if (this.getAttribute('loading') === 'lazy') {
            this.sight = new IntersectionObserver((entries) => { if (entries.some((entry) => entry.isIntersecting)) this.begin(); });
            this.sight.observe(this);
        } else {
            this.begin();
        }
    }

    disconnectedCallback(): void {
        this.sight?.disconnect();
        this.viewer?.dispose();
        this.viewer = null;
        this.shown = '';
        // A canvas keeps its context, and a page has few of them.
        this.canvas.getContext('webgl2')?.getExtension('WEBGL_lose_context')?.loseContext();
        const fresh = document.createElement('canvas');
        fresh.part.add('canvas');
        this.canvas.replaceWith(fresh);
        this.canvas = fresh;
    }

    attributeChangedCallback(): void {
        if (this.viewer) this.update();
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
        return Boolean(camera);
    }

    /** Goes back to where it began. */
    home(): void {
        this.viewer?.home();
    }

    /** A PNG image of what is shown. */
    toBlob(): Promise<Blob> {
        return this.viewer ? this.viewer.screenshot() : Promise.reject(new Error('nothing is shown yet'));
    }

    /** Shows the bytes of a file instead of `src`. An ArrayBuffer is handed over, and empty then. */
    show(bytes: ArrayBuffer | Uint8Array): void {
        this.begin();
        this.viewer?.open({ bytes: bytes instanceof ArrayBuffer ? bytes : bytes.slice().buffer as ArrayBuffer });
    }

    private begin(): void {
        this.sight?.disconnect();
        if (this.viewer) return;
        const most = Math.floor(Number(this.getAttribute('max-splats')));
        const maxSplats = most >= 1 ? most : Infinity;
        try {
            this.viewer = new Viewer(this.canvas, {
                info: () => this.viewer!.pose && this.startView(),
                progress: (bytes) => this.progressed(bytes),
                load: () => { this.bar.hidden = true; this.dispatchEvent(new Event('load')); },
                error: (error) => this.failed(error),
                camera: () => this.dispatchEvent(new Event('camera-change')),
            }, maxSplats);
        } catch (error) {
            return this.failed(error as Error);
        }
        this.canvas.addEventListener('pointerdown', () => { this.viewer!.autoRotate = 0; }, { once: true });
        this.update();
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
        const degrees = Number(this.getAttribute('rotation-per-second') ?? 12);
        viewer.autoRotate = this.hasAttribute('auto-rotate') ? degrees * Math.PI / 180 : 0;
        const colours = this.getAttribute('colours') ?? 'trained';
        viewer.colours = colours in COLOURS ? colours as Colours : 'trained';
        viewer.background = backgroundOf(this.getAttribute('background') ?? 'scene');
        if (this.src !== this.shown) {
            this.shown = this.src;
            this.failure.textContent = '';
            this.poster.hidden = false;
            try {
                if (this.src) viewer.open({ url: this.src });
            } catch (error) {
                this.failed(error as Error); // not an address
            }
        }
        viewer.invalidate();
    }

    private startView(): void {
        const name = this.getAttribute('view');
        if (name) this.goTo(name);
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
        this.failure.textContent = error.message;
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
