/** Maps in a texture that the hardware interpolates, for the fast path. */

import type { SceneInfo } from '../scene';
import type { Batches } from './batch';
import type { SplatBuffers } from './buffers';
import { ATLAS_COLUMNS, AtlasLayout } from './layout';
import { Pool } from './pool';
import type { Program } from './program';

/** Copies cost memory: three halvings along each axis are kept of up to this many texels, one of more. */
const TEXELS_OF_SMALL_SCENES = 400_000;
/** Texels of the atlas for each of maps, by halvings, so that it seldom grows. Measured: 4 to 11. */
const EXPECTED = { 1: 6, 3: 10 } as const;

export class Atlas {
    readonly halvings: 1 | 3;
    readonly places: Pool;
    /** Given more rows in place: others may have bound it. */
    readonly texture: WebGLTexture;
    rows = 0;
    private readonly layout: AtlasLayout;
    private readonly framebuffer: WebGLFramebuffer;
    private version = -1;

    /** `program`: that of `bake`. */
    constructor(
        private readonly gl: WebGL2RenderingContext, private readonly info: SceneInfo, private readonly buffers: SplatBuffers, private readonly batches: Batches, private readonly program: Program,
    ) {
        this.halvings = info.texels <= TEXELS_OF_SMALL_SCENES ? 3 : 1;
        this.places = new Pool(gl, 'r32ui', buffers.capacity);
        this.layout = new AtlasLayout(buffers.capacity, Math.min(65535, gl.getParameter(gl.MAX_TEXTURE_SIZE) as number), this.halvings);
        this.framebuffer = gl.createFramebuffer()!;
        this.texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.LINEAR);
        for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    }

    get bytes(): number {
        return 4 * ATLAS_COLUMNS * this.rows + this.places.bytes;
    }

    /** Takes the maps that have arrived. Leaves another framebuffer bound. */
    update(): void {
        const { buffers, layout } = this;
        if (this.version === buffers.version) return;
        this.version = buffers.version;
        layout.truncate(buffers.unchanged);
        buffers.unchanged = buffers.count;
        const first = layout.count, firstRow = layout.rows - 1;
        layout.extend(buffers.sides, buffers.count);
        this.places.write(first, layout.places.subarray(first, layout.count));
        if (layout.rows > this.rows) {
            this.grow();
            this.bake(0, 0);
        } else this.bake(first, firstRow);
    }

    dispose(): void {
        this.gl.deleteTexture(this.texture);
        this.gl.deleteFramebuffer(this.framebuffer);
        this.places.dispose();
    }

    /** Makes room for what is there, and for what is expected. */
    private grow(): void {
        const { gl, info, layout, buffers } = this;
        const toCome = Math.max(0, info.texels - buffers.numTexels) * EXPECTED[this.halvings] / ATLAS_COLUMNS;
        this.rows = Math.min(gl.getParameter(gl.MAX_TEXTURE_SIZE) as number, layout.rows + Math.ceil(toCome));
        gl.bindTexture(gl.TEXTURE_2D, this.texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, ATLAS_COLUMNS, this.rows, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.texture, 0);
    }

    /** Draws the blocks of splats from `first` on, which lie from row `firstRow` on. */
    private bake(first: number, firstRow: number): void {
        const { gl, program, buffers } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.viewport(0, 0, ATLAS_COLUMNS, this.rows);
        gl.disable(gl.BLEND);
        gl.enable(gl.SCISSOR_TEST);
        gl.scissor(0, firstRow, ATLAS_COLUMNS, this.rows - firstRow);
        gl.clearColor(128 / 255, 128 / 255, 128 / 255, 1);
        gl.clear(gl.COLOR_BUFFER_BIT);
        gl.useProgram(program.program);
        program.textures({ splats: buffers.splats, places: this.places, texels: buffers.texels });
        gl.uniform1i(program.uniform('first'), first);
        gl.uniform1i(program.uniform('end'), buffers.count);
        gl.uniform1i(program.uniform('halvings'), this.halvings);
        gl.uniform2f(program.uniform('atlasSize'), ATLAS_COLUMNS, this.rows);
        if (buffers.count > first) this.batches.draw(buffers.count - first);
        gl.disable(gl.SCISSOR_TEST);
    }
}
