/** How images are drawn: fast and, if need be, smaller while the camera moves, as well as the device can in time at rest. */

/** While the camera moves, images should take no longer. */
const MOVING_MS = 25;
/** Images whose median counts; fewer if these take as long as that many should. */
const IMAGES = 20;
/** How long the camera rests before the image is sharp again. */
const REST_MS = 150;
/** At rest, exact images are drawn where one takes less. */
const EXACT_MS = 100;
/** Time of an exact image against that of a fast one. Measured: 1.6 to 2.3. */
const EXACT_COST = 2;

/** What is given up in turn while the camera moves; each step halves the fragments or nearly so. */
const STEPS = [[1, 1], [0.71, 1], [0.5, 1], [0.5, 0.5], [0.5, 0.25], [0.35, 0.25], [0.25, 0.25]] as const;

export type Precision = 'auto' | 'exact' | 'fast';

/** How an image is drawn. */
export interface Plan {
    /** Size, compared with that at rest. */
    readonly ratio: number;
    /** Of the splats, those that contribute most. */
    readonly share: number;
    readonly precision: 'exact' | 'fast';
    readonly moving: boolean;
}

export class Pace {
    /** `auto`: fast, and exact at rest where that takes little time. */
    precision: Precision = 'auto';
    /** How the last image was drawn. */
    drawn: Plan = { ratio: 1, share: 1, precision: 'fast', moving: false };
    /** Index into STEPS. */
    private step = 0;
    /** Milliseconds of images whose median is not taken yet. */
    private readonly taken: number[] = [];
    /** Milliseconds of the last fast image at rest; null: not known. */
    private restMs: number | null = null;
    private exactIsSlow = false;
    private fence: WebGLSync | null = null;
    private startMs = 0;
    private lastMove = -Infinity;

    constructor(private readonly gl: WebGL2RenderingContext) {}

    moved(): void {
        // What was too slow may have been something else: one step more is tried each time.
        if (this.isResting(performance.now())) this.step = Math.max(0, this.step - 1);
        this.lastMove = performance.now();
    }

    /** Another scene or another size: nothing is known of its images at rest. */
    forget(): void {
        this.restMs = null;
        this.exactIsSlow = false;
    }

    isResting(time: number): boolean {
        return time - this.lastMove > REST_MS;
    }

    /** How the next image is drawn. */
    planAt(time: number): Plan {
        const moving = !this.isResting(time);
        const [ratio, share] = moving ? STEPS[this.step] : STEPS[0];
        return { ratio, share, moving, precision: this.precision !== 'auto' ? this.precision : !moving && this.exactIsCheap ? 'exact' : 'fast' };
    }

    /** Whether a better image than the last is due although nothing has changed, now or as soon as the camera has rested. */
    get isUnsettled(): boolean {
        return this.drawn.moving || (this.precision === 'auto' && this.drawn.precision === 'fast' && this.exactIsCheap);
    }

    draw(plan: Plan, paint: () => void): void {
        this.drawn = plan;
        this.startMs = performance.now();
        paint();
        this.fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    }

    /** The context has gone, and the image that was being drawn. */
    drop(): void {
        this.fence = null;
        this.forget();
    }

    get isDrawing(): boolean {
        return this.fence !== null;
    }

    /** Milliseconds that the last image took, once, when the GPU is done with it. */
    finished(): number | null {
        const { gl, fence } = this;
        if (!fence) return null;
        gl.flush();
        if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED && !gl.isContextLost()) return null;
        gl.deleteSync(fence);
        this.fence = null;
        const ms = performance.now() - this.startMs;
        this.learn(ms);
        return ms;
    }

    /** Takes the milliseconds of the last image. */
    learn(ms: number): void {
        const { drawn, taken } = this;
        if (!drawn.moving) {
            if (drawn.precision === 'fast') this.restMs = ms;
            else this.exactIsSlow ||= ms > EXACT_MS;
            return;
        }
        taken.push(ms);
        if (taken.length < IMAGES && taken.reduce((sum, one) => sum + one, 0) < IMAGES * MOVING_MS) return;
        const median = taken.sort((a, b) => a - b)[taken.length >> 1];
        taken.length = 0;
        if (median > MOVING_MS) this.step = Math.min(STEPS.length - 1, this.step + Math.max(1, Math.round(Math.log2(median / MOVING_MS))));
    }

    private get exactIsCheap(): boolean {
        return !this.exactIsSlow && this.restMs !== null && EXACT_COST * this.restMs < EXACT_MS;
    }
}
