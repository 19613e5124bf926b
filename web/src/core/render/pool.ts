/** A texture of WebGL2 used as a long array of texels: texel i stands in column i mod width, row floor(i / width). */

type Data = Float32Array | Uint32Array;

/** Formats of pools: RGB of 16 or 32 bits, and the packed splats. */
export type PoolFormat = 'rgb16f' | 'rgb32f' | 'rgba32ui';

export class Pool {
    readonly texture: WebGLTexture;
    readonly bytes: number;
    private readonly width: number;
    private readonly channels: number;

    /** Room for `capacity` texels. Throws if that is more than the device's textures hold: ask `poolCapacity`. */
    constructor(private readonly gl: WebGL2RenderingContext, private readonly format: PoolFormat, capacity: number) {
        this.width = poolWidth(gl);
        this.channels = format === 'rgba32ui' ? 4 : 3;
        const height = Math.max(1, Math.ceil(capacity / this.width));
        const internal = { rgb16f: gl.RGB16F, rgb32f: gl.RGB32F, rgba32ui: gl.RGBA32UI }[format];
        this.texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, internal, this.width, height);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
        for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
        this.bytes = this.width * height * { rgb16f: 6, rgb32f: 12, rgba32ui: 16 }[format];
    }

    /** Writes all of `data` from texel `first` on: the rest of a row, whole rows, the beginning of a row. */
    write(first: number, data: Data): void {
        const { gl, width, channels } = this;
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
        const count = data.length / channels;
        for (let done = 0; done < count;) {
            const column = (first + done) % width;
            const rows = column === 0 ? Math.floor((count - done) / width) : 0;
            const [columns, height] = rows > 0 ? [width, rows] : [Math.min(width - column, count - done), 1];
            const part = data.subarray(channels * done, channels * (done + columns * height));
            const [format, type] = this.format === 'rgba32ui' ? [gl.RGBA_INTEGER, gl.UNSIGNED_INT] : [gl.RGB, gl.FLOAT];
            gl.texSubImage2D(gl.TEXTURE_2D, 0, column, Math.floor((first + done) / width), columns, height, format, type, part);
            done += columns * height;
        }
    }

    dispose(): void {
        this.gl.deleteTexture(this.texture);
    }
}

/** Columns of a pool. A multiple of four: the four texels of a splat stand in one row. */
function poolWidth(gl: WebGL2RenderingContext): number {
    return Math.min(4096, gl.getParameter(gl.MAX_TEXTURE_SIZE) as number);
}

/** Texels that a pool can hold on this device. */
export function poolCapacity(gl: WebGL2RenderingContext): number {
    return poolWidth(gl) * (gl.getParameter(gl.MAX_TEXTURE_SIZE) as number);
}
