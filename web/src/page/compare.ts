/** The divider: on its left the scene, on its right the scene without textures, or the photo of the camera. */

import type { SceneCamera } from '../core/scene';
import { fitted } from '../viewer/pose';
import type { Viewer } from '../viewer/viewer';
import { byId, radios } from './dom';
import { clear, say } from './messages';

export type Comparison = 'off' | 'untextured' | 'photo';

const OPTIONS = [
    { value: 'off', label: 'Nothing' },
    { value: 'untextured', label: 'The scene without textures' },
    { value: 'photo', label: 'The photo of the camera' },
] as const;
/** Part of the width that a key moves the divider by. */
const KEY_STEP = 0.02;

export class Compare {
    mode: Comparison = 'off';
    /** Place of the divider: part of the window's width. */
    private at = 0.5;
    /** What photos there are, by the names of cameras. */
    private photos: ReadonlyMap<string, string> = new Map();
    private camera: SceneCamera | null = null;
    private exact = false;
    private failed = '';
    private readonly slider = byId('slider');
    private readonly image = byId<HTMLImageElement>('photo-image');
    private readonly choice: ReturnType<typeof radios<Comparison>>;

    constructor(private readonly viewer: Viewer) {
        this.choice = radios<Comparison>(byId('comparison'), OPTIONS, 'off', (mode) => this.choose(mode));
        this.slider.addEventListener('pointerdown', (event) => this.slider.setPointerCapture(event.pointerId));
        this.slider.addEventListener('pointermove', (event) => { if (event.buttons) this.move(event.clientX / this.viewer.canvas.clientWidth); });
        this.slider.addEventListener('keydown', (event) => this.key(event));
        this.image.addEventListener('error', () => { this.failed = this.image.src; this.update(); });
        this.image.addEventListener('load', () => this.update());
        new ResizeObserver(() => this.update()).observe(viewer.canvas);
        this.update();
    }

    /** Takes the photos of the capture: addresses by the names of cameras. */
    setPhotos(photos: ReadonlyMap<string, string>): void {
        this.photos = photos;
        this.update();
    }

    /** To be called when the camera is another, or is left. */
    setCamera(camera: SceneCamera | null, exact: boolean): void {
        this.camera = camera;
        this.exact = exact;
        this.update();
    }

    /** Changes to the next comparison that there is. */
    next(): void {
        const order: Comparison[] = this.photos.size ? ['off', 'untextured', 'photo'] : ['off', 'untextured'];
        this.choice.choose(order[(order.indexOf(this.mode) + 1) % order.length]);
    }

    private choose(mode: Comparison): void {
        this.mode = mode;
        // A photo shows one view only: that of its camera.
        if (mode === 'photo' && this.camera && !this.exact) this.viewer.goTo(this.camera);
        const { renderer } = this.viewer;
        this.viewer.compose = mode !== 'untextured' ? null : (view, options) => {
            const left = Math.round(this.at * view.widthPx);
            renderer.draw(view, { ...options, scissorPx: [0, 0, left, view.heightPx] });
            renderer.draw(view, { ...options, colours: 'untextured', scissorPx: [left, 0, view.widthPx - left, view.heightPx] });
        };
        this.viewer.invalidate();
        this.update();
    }

    private move(at: number): void {
        this.at = Math.min(1, Math.max(0, at));
        if (this.mode === 'untextured') this.viewer.invalidate();
        this.update();
    }

    private key(event: KeyboardEvent): void {
        const steps: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, Home: -Infinity, End: Infinity };
        if (!(event.key in steps)) return;
        event.preventDefault();
        this.move(this.at + steps[event.key] * KEY_STEP);
    }

    private update(): void {
        this.choice?.enable('photo', this.photos.size > 0);
        const photo = this.showPhoto();
        this.slider.hidden = !photo && this.mode !== 'untextured';
        this.slider.style.left = `${100 * this.at}%`;
        this.slider.setAttribute('aria-valuenow', String(Math.round(100 * this.at)));
        byId('left-side').textContent = 'scene';
        byId('right-side').textContent = this.mode === 'photo' ? 'photo' : 'without textures';
        const missing = this.missing();
        if (missing) say('photo', missing);
        else clear('photo');
        byId('comparison-note').textContent = missing || this.note();
    }

    /** Lays the photo over the camera's image, right of the divider. Returns whether it can be seen. */
    private showPhoto(): boolean {
        const url = this.mode === 'photo' && this.exact ? this.photos.get(this.camera!.name) : undefined;
        if (url && this.image.src !== url) {
            this.failed = '';
            this.image.src = url;
        }
        const shown = Boolean(url && this.image.complete && this.image.naturalWidth > 0 && this.failed !== url);
        const frame = byId('photo');
        frame.hidden = !shown;
        if (!shown) return false;
        const camera = this.camera!;
        const { clientWidth, clientHeight } = this.viewer.canvas;
        const { scale, x, y } = fitted(camera, clientWidth, clientHeight);
        const width = camera.widthPx * scale;
        Object.assign(frame.style, { left: `${x}px`, top: `${y}px`, width: `${width}px`, height: `${camera.heightPx * scale}px` });
        const hidden = Math.min(width, Math.max(0, Math.round(this.at * clientWidth) - x));
        frame.style.clipPath = `inset(0 0 0 ${hidden}px)`;
        return true;
    }

    /** Why there is no photo to show, if there should be one. */
    private missing(): string {
        if (this.mode !== 'photo' || !this.camera) return '';
        const { name } = this.camera, url = this.photos.get(name);
        if (!url) return `There is no photo of ${name}.`;
        return this.failed === url ? `The photo of ${name} cannot be read.` : '';
    }

    private note(): string {
        if (this.mode === 'photo' && !this.exact) return `The photo is hidden, because the view is no longer that of ${this.camera?.name}.`;
        return this.photos.size ? '' : 'Photos can be compared when the page is served by litetex view and it has the capture.';
    }
}
