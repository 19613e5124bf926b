/** A scene on a canvas: reads it as it arrives, moves the camera, and draws when something has changed. */

import type { SceneCamera, SceneInfo } from '../core/scene';
import type { Colours } from '../core/render/colours';
import { type DrawOptions, SplatRenderer } from '../core/render/renderer';
import type { View } from '../core/render/view';
import { startReading, startWorker } from '../core/worker/start';
import { errorOf, type FromWorker, type Source } from '../core/worker/messages';
import { sceneBounds, type Sphere } from './bounds';
import { Controls } from './controls';
import { homePose, type Pose } from './pose';

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
    /** An image has been drawn. */
    drawn?(frame: FrameFigures): void;
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
}

/** While the camera moves, images that take longer are drawn smaller. */
const MOVING_MS = 50;
const LEAST_RATIO = 0.25;
/** How long the camera rests before the image is sharp again. */
const REST_MS = 150;

export class Viewer {
    readonly renderer: SplatRenderer;
    readonly controls: Controls;
    pose: Pose | null = null;
    colours: Colours = 'trained';
    background: DrawOptions['background'];
    /** Radians per second around the target. */
    autoRotate = 0;
    info: SceneInfo | null = null;
    /** Drawn instead of the plain image, if set: for comparisons side by side. */
    compose: ((view: View, options: DrawOptions) => void) | null = null;
    private positions: Float32Array = new Float32Array(0);
    private bounds: Sphere | null = null;
    private reading: Worker | null = null;
    /** What has been read of a file that is shown only as a whole. */
    private held: FromWorker[] = [];
    /** The canvas keeps its image until a new scene is sorted. */
    private replacing = false;
    private generation = 0;
    private dirty = true;
    private frame = 0;
    private fence: WebGLSync | null = null;
    private fenceStart = 0;
    private lastTick = 0;
    private lastMove = -Infinity;
    /** Size of the next image while moving, and of the last one, compared with the canvas. */
    private ratio = 1;
    private drawnRatio = 1;
    private readonly resize: ResizeObserver;
    private readonly gone = new AbortController();

    constructor(readonly canvas: HTMLCanvasElement, private readonly events: ViewerEvents, private readonly maxSplats = Infinity) {
        this.renderer = new SplatRenderer(canvas, { maxSplats, onOrder: () => this.invalidate() });
        this.controls = new Controls(canvas, () => this.pose, () => this.moved());
        this.resize = new ResizeObserver(() => this.invalidate());
        this.resize.observe(canvas);
        canvas.addEventListener('webglcontextlost', (event) => {
            event.preventDefault();
            this.events.error?.(new Error('the graphics driver has stopped; reload the page'));
        }, { signal: this.gone.signal });
        this.invalidate();
    }

    /** Reads and shows a file. */
    open(source: Source, { keepPose = false, whole = keepPose }: OpenOptions = {}): void {
        this.close();
        const generation = ++this.generation;
        const take = whole ? this.hold : this.receive;
        const receive = (message: FromWorker) => { if (generation === this.generation) take.call(this, message, keepPose); };
        this.reading = startWorker(receive);
        startReading(this.reading, source, this.maxSplats);
    }

    /** Stops reading. */
    close(): void {
        this.generation++;
        this.reading?.terminate();
        this.reading = null;
        this.held = [];
    }

    /** Takes exactly the view of a camera of the capture. */
    goTo(camera: SceneCamera): void {
        if (!this.pose) return;
        const target = this.pose.target;
        this.pose.goTo(camera);
        this.pose.distance = Math.max(Math.hypot(...target.map((t, i) => t - this.pose!.centre[i])), 1e-6);
        this.moved();
    }

    /** Goes back to where it began. */
    home(): void {
        if (!this.info) return;
        this.pose = homePose(this.info, this.boundsOfScene());
        this.moved();
    }

    /** Draws soon. */
    invalidate(): void {
        this.dirty = true;
        if (!this.frame) this.frame = requestAnimationFrame((time) => this.tick(time));
    }

    /** What the canvas shows now, as a PNG image of its full size. */
    async screenshot(): Promise<Blob> {
        const wanted = this.sizedView(1);
        if (wanted) await this.renderer.sorted(wanted);
        // Meanwhile a smaller image may have been drawn, as while moving.
        const view = this.sizedView(1);
        if (view) this.paint(view);
        return new Promise((resolve, reject) => {
            this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('the browser makes no image'))), 'image/png');
        });
    }

    dispose(): void {
        this.gone.abort();
        this.close();
        cancelAnimationFrame(this.frame);
        this.resize.disconnect();
        this.controls.dispose();
        this.renderer.dispose();
    }

    /** Keeps what is read until all of it is there, then replaces the scene at once. */
    private hold(message: FromWorker, keepPose: boolean): void {
        if (message.kind === 'failed') return this.receive(message, keepPose);
        this.held.push(message);
        const first = this.held[0];
        if (message.kind === 'update' && first.kind === 'info') this.events.progress?.(message.update.bytes, first.info.fileBytes);
        if (message.kind !== 'done') return;
        this.replacing = true;
        for (const held of this.held.splice(0)) this.receive(held, keepPose);
        const view = this.sizedView(this.drawnRatio);
        void (view ? this.renderer.sorted(view) : Promise.resolve()).then(() => {
            this.replacing = false;
            this.invalidate();
        });
    }

    private receive(message: FromWorker, keepPose: boolean): void {
        switch (message.kind) {
            case 'info':
                this.info = message.info;
                this.positions = new Float32Array(0);
                this.renderer.start(message.info);
                if (!keepPose || !this.pose) this.pose = message.info.cameras.length ? homePose(message.info, { centre: [0, 0, 0], radius: 1 }) : null;
                this.events.info?.(message.info);
                break;
            case 'update': {
                const { first, splats } = message.update;
                this.renderer.apply(message.update);
                const positions = new Float32Array(3 * first + splats.positions.length);
                positions.set(this.positions.subarray(0, 3 * first));
                positions.set(splats.positions, 3 * first);
                this.positions = positions;
                this.bounds = null;
                this.pose ??= homePose(this.info!, this.boundsOfScene());
                this.events.progress?.(message.update.bytes, this.info!.fileBytes);
                break;
            }
            case 'done':
                this.reading?.terminate();
                this.reading = null;
                this.events.load?.();
                break;
            case 'failed':
                this.close();
                this.events.error?.(errorOf(message));
                return;
        }
        this.invalidate();
    }

    private moved(): void {
        this.lastMove = performance.now();
        this.events.camera?.();
        this.invalidate();
    }

    private tick(time: number): void {
        this.frame = 0;
        const secs = Math.min(0.1, (time - this.lastTick) / 1000);
        this.lastTick = time;
        if (this.controls.advance(secs)) this.moved();
        if (this.autoRotate && this.pose && !this.controls.active) {
            this.pose.turn(this.autoRotate * secs, 0);
            this.moved();
        }
        const waiting = this.pollFence() || this.replacing;
        const resting = time - this.lastMove > REST_MS;
        if (!waiting && (this.dirty || (resting && this.drawnRatio < 1))) {
            const ratio = resting ? 1 : this.ratio;
            const view = this.sizedView(ratio);
            this.drawnRatio = ratio;
            if (view) {
                this.dirty = false;
                this.fenceStart = performance.now();
                this.paint(view);
                this.fence = this.renderer.gl.fenceSync(this.renderer.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
            } else {
                this.dirty = false;
            }
        }
        const again = (this.dirty && !this.replacing) || this.fence || this.drawnRatio < 1 || this.controls.active || this.autoRotate;
        if (again && !this.frame) this.frame = requestAnimationFrame((next) => this.tick(next));
    }

    /** Whether the GPU still draws the last image; when it is done, chooses the size of the next while moving. */
    private pollFence(): boolean {
        const { gl } = this.renderer;
        if (!this.fence) return false;
        gl.flush();
        const status = gl.getSyncParameter(this.fence, gl.SYNC_STATUS);
        if (status !== gl.SIGNALED && !gl.isContextLost()) return true;
        gl.deleteSync(this.fence);
        this.fence = null;
        const ms = performance.now() - this.fenceStart;
        this.events.drawn?.({ ms, widthPx: this.canvas.width, heightPx: this.canvas.height });
        const wanted = this.drawnRatio * Math.sqrt(MOVING_MS / Math.max(ms, 1));
        // The ratio is for the next image, if the camera moves then; a resting camera gets the full size.
        this.ratio = Math.max(LEAST_RATIO, Math.min(1, wanted > 0.9 ? 1 : wanted));
        return false;
    }

    private sizedView(ratio: number): View | null {
        const scale = devicePixelRatio * ratio;
        const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((px) => Math.max(1, Math.round(px * scale)));
        if (!this.pose || !this.canvas.clientWidth) return null;
        if (this.canvas.width !== width || this.canvas.height !== height) [this.canvas.width, this.canvas.height] = [width, height];
        return this.pose.view(width, height);
    }

    private paint(view: View): void {
        const options: DrawOptions = {
            colours: this.colours,
            ...(this.background === undefined ? {} : { background: this.background }),
            ...(this.colours === 'depth' ? { depthRange: this.depthRange() } : {}),
        };
        if (this.compose) this.compose(view, options);
        else this.renderer.draw(view, options);
    }

    /** Depths between which most of the scene lies: of a sphere around it, or from a part of that if the camera is inside. */
    private depthRange(): [near: number, far: number] {
        const { centre, radius } = this.boundsOfScene();
        const distance = Math.hypot(...centre.map((c, i) => c - this.pose!.centre[i]));
        const far = distance + radius;
        return [Math.max(distance - radius, 0.05 * far), far];
    }

    private boundsOfScene(): Sphere {
        return this.bounds ??= sceneBounds(this.info!, () => this.positions);
    }
}
