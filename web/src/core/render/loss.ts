/** The loss of a WebGL context, which browsers decide on, or we; and its return. */

export class Loss {
    private readonly extension: WEBGL_lose_context | null;
    private readonly gone = new AbortController();
    private wanted = true;
    /** Whether it was we who gave the context up: only then we may ask for it. */
    private released = false;
    /** Whether the canvas has been told of the loss: before, browsers restore nothing. */
    private told: boolean;

    constructor(private readonly gl: WebGL2RenderingContext, lost: () => void, restored: () => void) {
        // To be had only while there is a context, but it stays.
        this.extension = gl.getExtension('WEBGL_lose_context');
        this.told = gl.isContextLost();
        const { signal } = this.gone;
        gl.canvas.addEventListener('webglcontextlost', (event) => {
            event.preventDefault(); // else it would never come back
            this.told = true;
            lost();
            setTimeout(() => this.ask());
        }, { signal });
        gl.canvas.addEventListener('webglcontextrestored', () => {
            this.told = this.released = false;
            if (this.wanted) restored();
            else this.release();
        }, { signal });
    }

    /** Gives the context up, now or as soon as the browser brings it back. */
    release(): void {
        this.wanted = false;
        if (this.gl.isContextLost() || !this.extension) return;
        this.released = true;
        this.extension.loseContext();
    }

    /** Asks for it again. What the browser has taken, it gives when it likes. */
    retake(): void {
        this.wanted = true;
        this.ask();
    }

    dispose(): void {
        this.wanted = false;
        this.gone.abort();
    }

    private ask(): void {
        if (!this.wanted || !this.released || !this.told || !this.gl.isContextLost()) return;
        this.released = false;
        this.extension!.restoreContext();
    }
}
