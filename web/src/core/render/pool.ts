/** A texture of WebGL2 used as a long array of texels: texel i stands in column i mod width, row floor(i / width). */

type Data = Float32Array | Uint32Array;

/** Formats of pools: RGB of 16 or 32 bits, the packed splats, and indices. */
export type PoolFormat = 'rgb16f' | 'rgb32f' | 'rgba32ui' | 'r32ui';

const CHANNELS = { rgb16f: 3, rgb32f: 3, rgba32ui: 4, r32ui: 1 } as const;
const BYTES = { rgb16f: 6, rgb32f: 12, rgba32ui: 16, r32ui: 4 } as const;

export class Pool {
    readonly texture: WebGLTexture;
    readonly bytes: number;
    private readonly width: number;
    private readonly channels: number;

    /** Room for `capacity` texels. Throws if that is more than the device's textures hold: ask `poolCapacity`. */
    constructor(private readonly gl: WebGL2RenderingContext, private readonly format: PoolFormat, capacity: number) {
        this.width = poolWidth(gl);
        this.channels = CHANNELS[format];
        const height = Math.max(1, Math.ceil(capacity / this.width));
        const internal = { rgb16f: gl.RGB16F, rgb32f: gl.RGB32F, rgba32ui: gl.RGBA32UI, r32ui: gl.R32UI }[format];
        this.texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, internal, this.width, height);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
        for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
        this.bytes = this.width * height * BYTES[format];
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
            const type = this.format.endsWith('ui') ? gl.UNSIGNED_INT : gl.FLOAT;
            const format = { 1: gl.RED_INTEGER, 3: gl.RGB, 4: gl.RGBA_INTEGER }[channels]!;
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
