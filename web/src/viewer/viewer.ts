/** A scene on a canvas: reads it as it arrives, moves the camera, and draws when something has changed. */

import { pick } from '../core/pick';
import type { SceneCamera, SceneInfo } from '../core/scene';
import type { Colours } from '../core/render/colours';
import { type DrawOptions, SplatRenderer } from '../core/render/renderer';
import type { View } from '../core/render/view';
import { startReading, type Workers } from '../core/worker/start';
import { errorOf, type FromWorker, type KeptFile, type Source, stored, type StoredSource } from '../core/worker/messages';
import { radiusPx, sceneBounds, type Sphere } from './bounds';
import { Controls } from './controls';
import { reducedMotion } from './motion';
import { Pace, type Plan, type Precision } from './pace';
import { fitted, homePose, keepNear, type Pose } from './pose';
import { pointAt, rayThrough } from './ray';
import { readSurfaces, type SplatSurfaces } from './surfaces';
import { add, sub, type Vec3 } from './vector';

export interface ViewerEvents {
    /** Header and metadata are there. */
    info?(info: SceneInfo): void;
    /** `bytes` of a file of `fileBytes` have been read. */
    progress?(bytes: number, fileBytes: number): void;
    /** The whole file is there. */
    load?(): void;
    /** The file cannot be shown. */
    error?(error: Error): void;
    /** The camera has moved. */
    camera?(): void;
    /** Someone moves the camera by mouse, touch or keys. */
    held?(): void;
    /** An image has been drawn. */
    drawn?(frame: FrameFigures): void;
    /** The browser has taken the context, so that the canvas is empty. */
    lost?(): void;
    /** It is there again. What was shown is read once more, without further events. */
    restored?(): void;
}

export interface OpenOptions {
    /** Leaves the camera where it is: for another version of the same scene. */
    keepPose?: boolean;
    /** Shows the scene of before until the whole file is there, and keeps it if the file cannot be shown. Default: `keepPose`. */
    whole?: boolean;
}

export interface FrameFigures {
    /** Milliseconds from the call until the GPU was done. */
    ms: number;
    widthPx: number;
    heightPx: number;
    precision: 'exact' | 'fast';
    /** Whether all of the file is there, in the right order: while the camera moves, slow devices show fewer splats all the same. */
    complete: boolean;
}

/** Phones have more pixels than anybody sees; each costs dozens of fragments. */
const MAX_PIXEL_RATIO = 2;
const TURNING_MS = 350;
/** On devices that draw too slowly, scenes of a smaller radius are drawn as their stand-in. Measured at 128 pixels: 28 to 31 dB. */
const FAR_RADIUS_PX = 64;

/** A file to read, and how. */
interface Reading {
    readonly source: StoredSource;
    readonly keepPose: boolean;
    readonly whole: boolean;
    /** It has been read before: nobody is told but of errors. */
    readonly again: boolean;
}

export class Viewer {
    readonly renderer: SplatRenderer;
    readonly controls: Controls;
    pose: Pose | null = null;
    colours: Colours = 'trained';
    background: DrawOptions['background'];
    /** Of files that are opened from now on, at most this many splats are shown: those that contribute most. */
    maxSplats = Infinity;
    /** Radians per second around the target. */
    autoRotate = 0;
    info: SceneInfo | null = null;
    /** Keeps the camera where photos were taken: within this reach of one, see `keepNear`. */
    reach = Infinity;
    /** A turn of the camera to a point, which it orbits around from then on. */
    private turning: { readonly from: Vec3; readonly to: Vec3; readonly startMs: number } | null = null;
    private looked: Promise<SplatSurfaces> | null = null;
    /** Drawn instead of the plain image, if set: for comparisons side by side. */
    compose: ((view: View, options: DrawOptions) => void) | null = null;
    private bounds: Sphere | null = null;
    private workers: Workers | null = null;
    /** What is being read, or will be once there is a context. */
    private reading: Reading | null = null;
    /** What is shown, once it has arrived as a whole: what is made of it goes with the context. */
    private kept: KeptFile | null = null;
    /** The whole file is there, and was sorted. */
    private complete = false;
    /** Counts scenes; the same one after the loss of the context is another. */
    private scene = 0;
    private completeDrawn = false;
    /** The whole file is there, but there was no view to sort it for. */
    private isUnsorted = false;
    /** Neither reads nor draws; the context is given up. */
    private isResting = false;
    /** What has been read of a file that is shown only as a whole. */
    private held: FromWorker[] = [];
    /** The canvas keeps its image until a new scene is sorted. */
    private replacing = false;
    private generation = 0;
    private dirty = true;
    private frame = 0;
    private fenceComplete = false;
    private readonly pace: Pace;
    private lastTick = 0;
    private readonly resize: ResizeObserver;

    /** `keys`: what keys are taken from, see Controls. */
    constructor(readonly canvas: HTMLCanvasElement, private readonly events: ViewerEvents, keys: EventTarget) {
        const viewer = this;
        this.renderer = new SplatRenderer(canvas, {
            get maxSplats() { return viewer.maxSplats; },
            onOrder: () => this.invalidate(), onLost: () => this.lost(), onRestored: () => this.restored(),
        });
        this.pace = new Pace(this.renderer.gl);
        this.controls = new Controls(canvas, () => this.pose, () => {
            this.events.held?.();
            this.moved();
        }, (x, y) => void this.focusOn(x, y).catch((error) => console.warn('focus:', error)), keys);
        this.resize = new ResizeObserver(() => {
            this.pace.forget();
            this.invalidate();
        });
        this.resize.observe(canvas);
        this.invalidate();
    }

    /** `auto` (default): fast while the camera moves, exact at rest where an image takes less than 100 ms. */
    get precision(): Precision {
        return this.pace.precision;
    }

    set precision(precision: Precision) {
        this.pace.precision = precision;
        this.invalidate();
    }

    /** Reads and shows a file. */
    open(source: Source, { keepPose = false, whole = keepPose }: OpenOptions = {}): void {
        this.close();
        this.read({ source: stored(source), keepPose, whole, again: false });
    }

    /** Stops reading. */
    close(): void {
        this.generation++;
        this.workers?.terminate();
        this.workers = this.reading = null;
        this.held = [];
    }

    /** Stops reading, and shows nothing. */
    clear(): void {
        this.close();
        this.scene++;
        this.looked = null;
        this.info = this.pose = this.bounds = this.kept = null;
        this.replacing = this.complete = this.completeDrawn = this.isUnsorted = false;
        this.canvas.width = 1; // empties it
    }

    /**
     * Gives the context up, of which browsers allow few on a page, until `wake`. Returns whether the image, which the canvas
     * shows no longer, has been drawn onto `still`: it is unless it was not complete.
     */
    rest(still: HTMLCanvasElement): boolean {
        const { canvas, pose } = this;
        this.isResting = true;
        this.controls.letGo();
        const isDrawn = Boolean(this.completeDrawn && pose && !this.renderer.lost);
        if (isDrawn) {
            this.paint(pose!.view(canvas.width, canvas.height), this.pace.planAt(Infinity));
            Object.assign(still, { width: canvas.width, height: canvas.height });
            still.getContext('2d')!.drawImage(canvas, 0, 0);
        }
        this.renderer.release();
        return isDrawn;
    }

    /** Takes the context again, and shows what it showed; `drawn` tells when. */
    wake(): void {
        this.isResting = false;
        this.renderer.retake();
        this.invalidate();
    }

    /** Takes exactly the view of a camera of the capture. */
    goTo(camera: SceneCamera): void {
        if (!this.pose) return;
        const target = this.pose.target;
        this.halt();
        this.pose.goTo(camera);
        this.pose.distance = Math.max(Math.hypot(...target.map((t, i) => t - this.pose!.centre[i])), 1e-6);
        this.moved();
    }

    /** Goes back to where it began. */
    home(): void {
        if (!this.info) return;
        this.halt();
        this.pose = homePose(this.info, this.boundsOfScene());
        this.moved();
    }

    /** The splats that are shown, for picking: read once more, without colours. Rejects while the file is not there as a whole. */
    async surfaces(): Promise<SplatSurfaces> {
        if (!this.kept) throw new Error('The file is still being read');
        const { scene } = this;
        const looked = this.looked ??= readSurfaces(this.kept, this.maxSplats);
        looked.catch(() => { if (scene === this.scene) this.looked = null; });
        return looked;
    }

    /** Turns to the surface that is shown at a place of the canvas, CSS px, and orbits around it from then on. Resolves to whether there is one. */
    async focusOn(x: number, y: number): Promise<boolean> {
        const { pose, info, scene, canvas } = this;
        if (!pose || !info) return false;
        const ray = rayThrough(pose.view(canvas.clientWidth, canvas.clientHeight), [x, y], info.near);
        const found = pick(await this.surfaces(), ray);
        if (!found || scene !== this.scene || pose !== this.pose) return false;
        this.turning = { from: pose.target, to: pointAt(ray, found.distance), startMs: performance.now() };
        this.invalidate();
        return true;
    }

    /** Whether the image of the camera that was gone to lies in the canvas whole, so that its photo can be laid over it. */
    get isWhole(): boolean {
        const { pose, canvas: { clientWidth, clientHeight } } = this;
        if (!pose?.covers) return true;
        const [covering, whole] = [true, false].map((covers) => fitted(pose.lens, clientWidth, clientHeight, covers).scale);
        return covering * Math.max(clientWidth, clientHeight) < whole * Math.max(clientWidth, clientHeight) + whole;
    }

    /** Draws soon. */
    invalidate(): void {
        this.dirty = true;
        if (!this.frame) this.frame = requestAnimationFrame((time) => this.tick(time));
    }

    /** What the canvas shows now, as a PNG image of its full size. */
    async screenshot(): Promise<Blob> {
        if (this.renderer.lost) throw new Error(this.isResting ? 'nothing is shown yet' : 'the graphics driver has stopped');
        const wanted = this.sizedView(1);
        if (wanted) await this.renderer.sorted(wanted);
        // Meanwhile a smaller image may have been drawn, as while moving.
        const view = this.sizedView(1);
        if (!view) throw new Error('nothing is shown yet');
        this.paint(view, { ...this.pace.planAt(Infinity), precision: this.precision === 'fast' ? 'fast' : 'exact' });
        return new Promise((resolve, reject) => {
            this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('the browser makes no image'))), 'image/png');
        });
    }

    dispose(): void {
        this.close();
        cancelAnimationFrame(this.frame);
        this.resize.disconnect();
        this.controls.dispose();
        this.renderer.dispose();
    }

    private read(reading: Reading): void {
        this.reading = reading;
        if (this.renderer.lost) return; // until it is restored
        const generation = ++this.generation;
        const take = reading.whole ? this.hold : this.receive;
        this.workers = startReading(reading.source, this.maxSplats, (message) => { if (generation === this.generation) take.call(this, message, reading); });
    }

    private lost(): void {
        this.generation++;
        this.workers?.terminate();
        this.workers = null;
        this.pace.drop();
        this.held = [];
        this.scene++;
        this.looked = null;
        this.replacing = this.complete = this.completeDrawn = this.isUnsorted = false;
        if (this.info) this.boundsOfScene(); // as long as the centres are there
        if (!this.isResting) this.events.lost?.();
    }

    /** Everything in the context has gone with it. Of a file that had not arrived as a whole, reading begins anew. */
    private restored(): void {
        const { reading, kept } = this;
        this.events.restored?.();
        // Whoever has moved the camera meanwhile keeps it.
        if (reading) this.read({ ...reading, keepPose: reading.keepPose || Boolean(this.pose && this.info) });
        else if (kept) this.read({ source: kept, keepPose: true, whole: false, again: true });
        this.invalidate();
    }

    /** Keeps what is read until all of it is there, then replaces the scene at once. */
    private hold(message: FromWorker, reading: Reading): void {
        if (message.kind === 'failed') return this.receive(message, reading);
        this.held.push(message);
        const first = this.held[0];
        if (message.kind === 'update' && first.kind === 'info') this.events.progress?.(message.update.bytes, first.info.fileBytes);
        if (message.kind !== 'done') return;
        for (const held of this.held.splice(0)) this.receive(held, reading);
    }

    private receive(message: FromWorker, reading: Reading): void {
        const { keepPose, again } = reading;
        switch (message.kind) {
            case 'info':
                this.info = message.info;
                this.scene++;
                this.looked = null;
                this.bounds = null;
                this.replacing = reading.whole;
                this.complete = this.completeDrawn = this.isUnsorted = false;
                this.kept = again ? this.kept : null;
                this.renderer.start(message.info);
                this.pace.forget();
                if (!keepPose || !this.pose) this.pose = message.info.cameras.length ? homePose(message.info, { centre: [0, 0, 0], radius: 1 }) : null;
                if (!again) this.events.info?.(message.info);
                break;
            case 'standIn':
                this.renderer.setStandIn(message.splats);
                this.pose ??= homePose(this.info!, sceneBounds(this.info!, () => message.splats.positions));
                break;
            case 'update':
                this.renderer.apply(message.update);
                this.bounds = null;
                this.pose ??= homePose(this.info!, this.boundsOfScene());
                if (!again) this.events.progress?.(message.update.bytes, this.info!.fileBytes);
                break;
            case 'done':
                this.workers?.terminate();
                this.workers = this.reading = null;
                this.kept = message.kept;
                if (!again) this.events.load?.();
                void this.complement();
                break;
            case 'failed':
                this.close();
                this.events.error?.(errorOf(message));
                return;
        }
        this.invalidate();
    }

    /** Waits for the order of all splats: then images are complete. */
    private async complement(): Promise<void> {
        // Whoever hears of `load` may give the context up. Once it is back, the file is read again, and only then can images be complete.
        if (this.renderer.lost) return;
        const { scene } = this;
        const view = this.sizedView(this.pace.drawn.ratio);
        if (!view) {
            // Nothing can be sorted for a canvas without an area: as soon as it has one.
            this.replacing = false;
            this.isUnsorted = true;
            return;
        }
        await this.renderer.sorted(view);
        if (scene !== this.scene) return;
        this.complete = true;
        this.replacing = false;
        this.invalidate();
    }

    /** Ends motion that goes on by itself. */
    private halt(): void {
        this.turning = null;
        this.controls.halt();
    }

    /** Turns on towards a point. */
    private turn(time: number): void {
        const { pose, turning } = this;
        if (!pose || !turning) return;
        const done = reducedMotion?.matches ? 1 : Math.min(1, Math.max(0, (time - turning.startMs) / TURNING_MS));
        pose.lookAt(add(turning.from, sub(turning.to, turning.from), done * done * (3 - 2 * done)));
        if (done === 1) this.turning = null;
        this.moved();
    }

    private moved(): void {
        if (this.pose && this.info && this.reach < Infinity) keepNear(this.pose, this.info.cameras, this.reach);
        this.pace.moved();
        this.events.camera?.();
        this.invalidate();
    }

    private tick(time: number): void {
        this.frame = 0;
        if (this.renderer.lost) return; // `restored` goes on
        const secs = Math.min(0.1, (time - this.lastTick) / 1000);
        this.lastTick = time;
        if (this.controls.advance(secs)) {
            this.turning = null;
            this.moved();
        }
        this.turn(time);
        if (this.autoRotate && this.pose && !this.controls.active) {
            this.pose.turn(this.autoRotate * secs, 0);
            this.moved();
        }
        const { pace } = this;
        this.finish();
        const isWaiting = pace.isDrawing || this.replacing;
        if (!isWaiting && (this.dirty || (pace.isUnsettled && pace.isResting(time)))) {
            this.dirty = false;
            const plan = pace.planAt(time);
            const view = this.sizedView(plan.ratio);
            if (view && this.isUnsorted) {
                this.isUnsorted = false;
                void this.complement();
            }
            if (view) {
                this.fenceComplete = this.complete;
                pace.draw(plan, () => this.paint(view, plan));
            }
        }
        const again = (this.dirty && !this.replacing) || pace.isDrawing || pace.isUnsettled || this.controls.active || this.turning || this.autoRotate;
        if (again && !this.frame) this.frame = requestAnimationFrame((next) => this.tick(next));
    }

    /** Tells of the last image when the GPU is done with it. */
    private finish(): void {
        const ms = this.pace.finished();
        if (ms === null) return;
        this.completeDrawn = this.fenceComplete && this.complete;
        this.events.drawn?.({ ms, widthPx: this.canvas.width, heightPx: this.canvas.height, precision: this.pace.drawn.precision, complete: this.completeDrawn });
    }

    private sizedView(ratio: number): View | null {
        const scale = Math.min(MAX_PIXEL_RATIO, devicePixelRatio) * ratio;
        const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((px) => Math.max(1, Math.round(px * scale)));
        if (!this.pose || !this.canvas.clientWidth) return null;
        if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
        return this.pose.view(width, height);
    }

    private paint(view: View, plan: Plan): void {
        const { precision, moving } = plan;
        const options: DrawOptions = {
            colours: this.colours,
            precision,
            onCanvas: moving && precision === 'fast',
            ...this.fewer(plan, view),
            ...(this.background === undefined ? {} : { background: this.background }),
            ...(this.colours === 'depth' ? { depthRange: this.depthRange() } : {}),
        };
        if (this.compose) this.compose(view, options);
        else this.renderer.draw(view, options);
    }

    /** What is drawn where all splats take too long. */
    private fewer({ ratio, share }: Plan, { focalPx }: View): DrawOptions {
        if (ratio === 1 && share === 1) return {};
        const { renderer } = this;
        const isFar = () => {
            const { centre, radius } = this.boundsOfScene();
            return radiusPx(radius, Math.hypot(...centre.map((c, i) => c - this.pose!.centre[i])), focalPx[0]) < FAR_RADIUS_PX;
        };
        if (renderer.hasStandIn && (share < 1 || isFar())) return { standIn: true };
        return share < 1 ? { maxSplats: Math.ceil(share * renderer.figures.splats) } : {};
    }

    /** Depths between which most of the scene lies: of a sphere around it, or from a part of that if the camera is inside. */
    private depthRange(): [near: number, far: number] {
        const { centre, radius } = this.boundsOfScene();
        const distance = Math.hypot(...centre.map((c, i) => c - this.pose!.centre[i]));
        const far = distance + radius;
        return [Math.max(distance - radius, 0.05 * far), far];
    }

    private boundsOfScene(): Sphere {
        return this.bounds ??= sceneBounds(this.info!, () => this.renderer.centres);
    }
}
