/** How large images are drawn while the camera moves: as large as the GPU draws them in time. */

/** While the camera moves, images that take longer are drawn smaller. */
const MOVING_MS = 50;
const LEAST_RATIO = 0.25;
/** How long the camera rests before the image is sharp again. */
const REST_MS = 150;

export class Pace {
    /** Size of the last image, compared with the canvas. */
    drawnRatio = 1;
    /** That of the next, if the camera moves then. */
    private ratio = 1;
    private fence: WebGLSync | null = null;
    private startMs = 0;
    private lastMove = -Infinity;

    constructor(private readonly gl: WebGL2RenderingContext) {}

    moved(): void {
        this.lastMove = performance.now();
    }

    isResting(time: number): boolean {
        return time - this.lastMove > REST_MS;
    }

    ratioAt(time: number): number {
        return this.isResting(time) ? 1 : this.ratio;
    }

    /** Draws an image of the last `drawnRatio`. */
    draw(paint: () => void): void {
        this.startMs = performance.now();
        paint();
        this.fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    }

    /** The context has gone, and the image that was being drawn. */
    drop(): void {
        this.fence = null;
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
        const wanted = this.drawnRatio * Math.sqrt(MOVING_MS / Math.max(ms, 1));
        this.ratio = Math.max(LEAST_RATIO, Math.min(1, wanted > 0.9 ? 1 : wanted));
        return ms;
    }
}
