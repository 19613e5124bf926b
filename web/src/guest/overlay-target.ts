/** What splats are blended in before they are laid over a render target of another engine. */

export class OverlayTarget {
    /** The splats, and a copy of what stands behind them. */
    readonly colours: WebGLTexture;
    readonly behind: WebGLTexture;
    private readonly framebuffers: { readonly colours: WebGLFramebuffer; readonly behind: WebGLFramebuffer; readonly drawn: WebGLFramebuffer };
    private readonly samplesBuffer: WebGLRenderbuffer | null = null;
    /** The depth that it shares; not yet any that works. */
    private depth: WebGLRenderbuffer | WebGLTexture | null | undefined;

    /** `format`: that of the copy. Leaves other bindings. */
    constructor(private readonly gl: WebGL2RenderingContext, readonly width: number, readonly height: number, samples: number, format: number) {
        this.colours = this.texture(gl.RGBA16F);
        this.behind = this.texture(format);
        const [colours, behind] = [this.colours, this.behind].map((texture) => {
            const framebuffer = gl.createFramebuffer()!;
            gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
            gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
            return framebuffer;
        });
        let drawn = colours;
        if (samples > 0) {
            this.samplesBuffer = gl.createRenderbuffer()!;
            gl.bindRenderbuffer(gl.RENDERBUFFER, this.samplesBuffer);
            gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, gl.RGBA16F, width, height);
            gl.bindRenderbuffer(gl.RENDERBUFFER, null);
            drawn = gl.createFramebuffer()!;
            gl.bindFramebuffer(gl.FRAMEBUFFER, drawn);
            gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.RENDERBUFFER, this.samplesBuffer);
        }
        this.framebuffers = { colours, behind, drawn };
    }

    /** Binds it, with a depth buffer or texture of another target. False if the device does not allow that. */
    share(depth: WebGLRenderbuffer | WebGLTexture | null, type: number): boolean {
        const { gl } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffers.drawn);
        if (this.depth === depth) return true;
        if (type === gl.TEXTURE) gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
        else gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, depth);
        const isComplete = gl.checkFramebufferStatus(gl.FRAMEBUFFER) === gl.FRAMEBUFFER_COMPLETE;
        this.depth = isComplete ? depth : undefined;
        return isComplete;
    }

    /** Copies what stands in `bound`, and binds that again. */
    resolve(bound: WebGLFramebuffer): void {
        const { colours, behind, drawn } = this.framebuffers;
        if (drawn !== colours) this.copy(drawn, colours);
        this.copy(bound, behind);
        this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, bound);
    }

    dispose(): void {
        const { gl } = this;
        for (const texture of [this.colours, this.behind]) gl.deleteTexture(texture);
        for (const framebuffer of Object.values(this.framebuffers)) gl.deleteFramebuffer(framebuffer);
        gl.deleteRenderbuffer(this.samplesBuffer);
    }

    private copy(from: WebGLFramebuffer, to: WebGLFramebuffer): void {
        const { gl, width, height } = this;
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, to);
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, from);
        gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    }

    private texture(format: number): WebGLTexture {
        const { gl } = this;
        const texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, format, this.width, this.height);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
        return texture;
    }
}
