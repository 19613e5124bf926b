/**
 * The fast path: one pass projects each splat once, into a record of 64 bytes in drawing order; quads fetch their record, fragments
 * divide once and let the hardware interpolate the map. Textures, colours and axes have 8 to 11 bits.
 */

import { Atlas } from './atlas';
import type { Batches } from './batch';
import type { SplatBuffers } from './buffers';
import { ATLAS_COLUMNS } from './layout';
import { bakeProgram, type Program, quadProgram, recordProgram, RECORDS_PER_ROW } from './program';
import { type Frame, setProjection, variantOf } from './projection';

/** Attachments of 16 bytes, as many as every WebGL2 device has. */
const PARTS = ['place', 'falloff', 'shape', 'paint'] as const;

export class FastPath {
    private readonly record: Program;
    private readonly bake: Program;
    private readonly quads = new Map<string, Program>();
    private readonly framebuffer: WebGLFramebuffer;
    /** Given more rows in place: others may have bound them. */
    private readonly records: Readonly<Record<typeof PARTS[number], WebGLTexture>>;
    private rows = 0;
    /** Of the scene, and of its stand-in. */
    private readonly atlases = new Map<SplatBuffers, Atlas>();
    /** What the records are of. */
    private recorded = '';
    private scene: SplatBuffers | null = null;

    constructor(private readonly gl: WebGL2RenderingContext, private readonly batches: Batches) {
        this.record = recordProgram(gl);
        this.bake = bakeProgram(gl);
        this.framebuffer = gl.createFramebuffer()!;
        this.records = Object.fromEntries(PARTS.map((part) => [part, gl.createTexture()!])) as typeof this.records;
    }

    /** Makes the shader of trained colours, which the first image would wait for. */
    compile(): void {
        this.quad('');
    }

    get bytes(): number {
        return [...this.atlases.values()].reduce((sum, atlas) => sum + atlas.bytes, 0) + 16 * PARTS.length * RECORDS_PER_ROW * this.rows;
    }

    /** Whether `prepare` has nothing to do for an image. */
    has(frame: Frame): boolean {
        return this.scene === frame.buffers && this.recorded === keyOf(frame);
    }

    /** Makes the records of an image and what they refer to, unless they are there. Leaves another framebuffer bound. */
    prepare(frame: Frame): void {
        if (this.has(frame)) return;
        const { buffers, info } = frame;
        this.scene = buffers;
        if (!this.atlases.has(buffers)) this.atlases.set(buffers, new Atlas(this.gl, info, buffers, this.batches, this.bake));
        this.atlas!.update();
        this.recorded = keyOf(frame);
        this.project(frame);
    }

    /** Drops what was made of splats that go. */
    forget(buffers: SplatBuffers): void {
        this.atlases.get(buffers)?.dispose();
        this.atlases.delete(buffers);
        if (this.scene === buffers) this.scene = null;
    }

    /** That of the splats that the records are of. */
    private get atlas(): Atlas | undefined {
        return this.scene ? this.atlases.get(this.scene) : undefined;
    }

    /** What `prepare` made, by the names of the quads' samplers. */
    get textures() {
        const { atlas, scene, records } = this;
        return { ...records, splats: scene!.splats.texture, means: scene!.means.texture, places: atlas!.places.texture, atlas: atlas!.texture };
    }

    /** Texels. */
    get atlasSize(): [columns: number, rows: number] {
        return [ATLAS_COLUMNS, this.atlas!.rows];
    }

    /** Draws what was prepared onto what is bound; the caller blends. */
    draw(frame: Frame): void {
        const { gl } = this;
        const { view, depth } = frame;
        // Depths by the hardware's clipping alone have too few digits to be tested or shown.
        const isExact = depth !== undefined || frame.colours === 'depth';
        const program = this.quad(variantOf(frame) + (isExact ? '#define EXACT_DEPTH\n' : ''));
        gl.useProgram(program.program);
        program.textures(this.textures);
        gl.uniform1i(program.uniform('drawn'), frame.drawn);
        gl.uniform2f(program.uniform('size'), view.widthPx, view.heightPx);
        gl.uniform2f(program.uniform('atlasSize'), ...this.atlasSize);
        if (isExact) {
            gl.uniformMatrix3fv(program.uniform('cameraFromData'), true, view.rotation);
            gl.uniform3f(program.uniform('translation'), ...view.translation);
            gl.uniform2f(program.uniform('principal'), ...view.principalPx);
            gl.uniform2f(program.uniform('depthFromInverse'), ...depth?.fromInverse ?? [0, 0] as const);
            gl.uniform2f(program.uniform('depthSlope'), ...depth?.slope ?? [0, 0] as const);
            gl.uniform1f(program.uniform('near'), frame.info.near);
            gl.uniform2f(program.uniform('depthRange'), Math.log(frame.depthRange[0]), Math.log(frame.depthRange[1]));
        }
        this.batches.draw(frame.drawn);
    }

    dispose(): void {
        Object.values(this.records).forEach((texture) => this.gl.deleteTexture(texture));
        this.atlases.forEach((atlas) => atlas.dispose());
        this.gl.deleteFramebuffer(this.framebuffer);
        this.record.dispose();
        this.bake.dispose();
        this.quads.forEach((program) => program.dispose());
    }

    private quad(variant: string): Program {
        const made = this.quads.get(variant) ?? quadProgram(this.gl, variant);
        this.quads.set(variant, made);
        return made;
    }

    private project(frame: Frame): void {
        const { gl, record } = this;
        const rows = Math.max(1, Math.ceil(frame.drawn / RECORDS_PER_ROW));
        if (rows > this.rows) this.makeRecords(Math.max(rows, Math.ceil(frame.buffers.capacity / RECORDS_PER_ROW)));
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        gl.viewport(0, 0, RECORDS_PER_ROW, rows);
        gl.disable(gl.BLEND);
        gl.disable(gl.SCISSOR_TEST);
        gl.useProgram(record.program);
        setProjection(gl, record, frame);
        gl.uniform1i(record.uniform('halvings'), this.atlas!.halvings);
        gl.bindVertexArray(null);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }

    private makeRecords(rows: number): void {
        const { gl } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
        PARTS.forEach((part, i) => {
            const texture = this.records[part];
            gl.bindTexture(gl.TEXTURE_2D, texture);
            gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32UI, RECORDS_PER_ROW, rows, 0, gl.RGBA_INTEGER, gl.UNSIGNED_INT, null);
            for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
            gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0);
        });
        gl.drawBuffers(PARTS.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
        this.rows = rows;
    }
}

/** All that records depend on. */
function keyOf({ view, buffers, orderVersion, drawn, budget, colours }: Frame): string {
    const { rotation, translation, focalPx, principalPx, widthPx, heightPx } = view;
    return [colours, budget, drawn, orderVersion, buffers.version, widthPx, heightPx, ...rotation, ...translation, ...focalPx, ...principalPx].join();
}
