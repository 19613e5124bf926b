/** What images are blended in: more than 8 bits, so that hundreds of layers do not add up their rounding. */

export type TargetFormat = 'rgba16f' | 'rgba32f';

export class Target {
    readonly framebuffer: WebGLFramebuffer;
    readonly texture: WebGLTexture;

    constructor(private readonly gl: WebGL2RenderingContext, readonly format: TargetFormat, readonly widthPx: number, readonly heightPx: number) {
        this.texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, format === 'rgba16f' ? gl.RGBA16F : gl.RGBA32F, widthPx, heightPx);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
        this.framebuffer = gl.createFramebuffer()!;
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    }

    /** The image, premultiplied RGBA, rows from the top. */
    read(): Float32Array {
        const { gl, widthPx, heightPx } = this;
        const bottomUp = new Float32Array(4 * widthPx * heightPx);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.readPixels(0, 0, widthPx, heightPx, gl.RGBA, gl.FLOAT, bottomUp);
        const image = new Float32Array(bottomUp.length);
        for (let row = 0; row < heightPx; row++) {
            image.set(bottomUp.subarray(4 * widthPx * (heightPx - 1 - row), 4 * widthPx * (heightPx - row)), 4 * widthPx * row);
        }
        return image;
    }

    dispose(): void {
        this.gl.deleteFramebuffer(this.framebuffer);
        this.gl.deleteTexture(this.texture);
    }
}

/** The best format that this device blends in; null: images go straight to the canvas, with its 8 bits. */
export function bestTarget(gl: WebGL2RenderingContext): TargetFormat | null {
    const blends = gl.getExtension('EXT_color_buffer_float') ?? gl.getExtension('EXT_color_buffer_half_float');
    return blends ? 'rgba16f' : null;
}
