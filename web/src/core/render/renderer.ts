/** Draws a scene with WebGL2, into a target of 16 bits and from there onto the canvas. */

import type { SceneInfo, SplatUpdate } from '../scene';
import { type Precision, SplatBuffers } from './buffers';
import { classColours, COLOURS, type Colours } from './colours';
import { Order } from './order';
import { type Program, resolveProgram, splatProgram } from './program';
import { bestTarget, Target, type TargetFormat } from './targets';
import { centreOf, type View } from './view';

export interface RendererOptions {
    /** Bits of colours and texels on the GPU. Default: half. */
    precision?: Precision;
    /** What images are blended in. Default: 16 bits where the device can, else `canvas`: the canvas's 8 bits. */
    target?: TargetFormat | 'canvas';
    /** Called when another order is there, so that an image should be drawn. */
    onOrder?: () => void;
    /** Shows at most this many splats, those that contribute most: for weak devices. */
    maxSplats?: number;
    /** For measurements: what stands before the fragment shader, `#define COUNT_FRAGMENTS` or `#define COUNT_DRAWN`. */
    defines?: string;
}

export interface DrawOptions {
    colours?: Colours;
    /** Behind the splats, in the colour space of the scene; null: transparent. Default: that of the scene. */
    background?: readonly [number, number, number] | null;
    /** Depths that are shown as white and black where colours show depth, units of the data. */
    depthRange?: readonly [near: number, far: number];
    /** Part of the image to draw, px from the upper left corner: the rest of the canvas is kept. */
    scissorPx?: readonly [x: number, y: number, width: number, height: number];
}

export class SplatRenderer {
    readonly gl: WebGL2RenderingContext;
    info: SceneInfo | null = null;
    private readonly order: Order;
    private readonly program: Program;
    private readonly resolve: Program;
    private readonly vertexArray: WebGLVertexArrayObject;
    private readonly indices: WebGLBuffer;
    private readonly format: TargetFormat | null;
    private buffers: SplatBuffers | null = null;
    private target: Target | null = null;
    private drawn = 0;

    constructor(readonly canvas: HTMLCanvasElement | OffscreenCanvas, private readonly options: RendererOptions = {}) {
        const gl = canvas.getContext('webgl2', { antialias: false, depth: false, premultipliedAlpha: true, powerPreference: 'high-performance' });
        if (!gl) throw new Error('this browser has no WebGL2');
        this.gl = gl as WebGL2RenderingContext;
        const best = bestTarget(this.gl); // also allows targets of floats that options ask for
        this.format = options.target === 'canvas' ? null : options.target ?? best;
        if (this.format === 'rgba32f') this.gl.getExtension('EXT_float_blend');
        this.program = splatProgram(this.gl, options.defines);
        this.resolve = resolveProgram(this.gl);
        this.vertexArray = this.gl.createVertexArray()!;
        this.indices = this.gl.createBuffer()!;
        this.gl.bindVertexArray(this.vertexArray);
        this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.indices);
        this.gl.enableVertexAttribArray(0);
        this.gl.vertexAttribIPointer(0, 1, this.gl.UNSIGNED_INT, 0, 0);
        this.gl.vertexAttribDivisor(0, 1);
        this.order = new Order((order) => this.setOrder(order));
    }

    /** Begins a scene; the one before is dropped. */
    start(info: SceneInfo): void {
        this.buffers?.dispose();
        this.buffers = new SplatBuffers(this.gl, info, this.options.precision ?? 'half', this.options.maxSplats);
        this.info = info;
        this.drawn = 0;
        this.order.setPositions(0, new Float32Array(0));
    }

    /** Takes splats as they arrive. Those of before are drawn until the next order is there. */
    apply(update: SplatUpdate): void {
        const kept = this.buffers!.apply(update);
        this.order.setPositions(update.first, update.splats.positions.subarray(0, 3 * kept));
    }

    /** Splats and texels on the GPU, bytes of its memory, milliseconds of the last sort. */
    get figures(): { splats: number; texels: number; bytes: number; sortMs: number } {
        const { count = 0, numTexels = 0, bytes = 0 } = this.buffers ?? {};
        return { splats: count, texels: numTexels, bytes, sortMs: this.order.lastMs };
    }

    /** Asks for the splats' order in a view, and waits until it is there. */
    async sorted(view: View): Promise<void> {
        this.order.request(view);
        await this.order.settled();
    }

    /** Draws with the order that is there, and asks for the right one if that is of another direction. */
    draw(view: View, options: DrawOptions = {}): void {
        const { gl, info, buffers } = this;
        if (!info || !buffers || gl.isContextLost()) return;
        this.order.request(view);
        const target = this.targetOf(view);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target?.framebuffer ?? null);
        gl.viewport(0, 0, view.widthPx, view.heightPx);
        this.scissor(view, options.scissorPx);
        const background = options.background === undefined ? info.background : options.background;
        gl.clearColor(...(background ?? [0, 0, 0] as const), background ? 1 : 0);
        gl.clear(gl.COLOR_BUFFER_BIT);
        this.drawSplats(view, info, buffers, options);
        if (target) this.resolveOntoCanvas(target, info);
    }

    /** The image last drawn, before it became one of 8 bits: premultiplied RGBA, rows from the top. */
    read(): Float32Array {
        if (!this.target) throw new Error('nothing is drawn into a target of floats');
        return this.target.read();
    }

    dispose(): void {
        this.order.dispose();
        this.buffers?.dispose();
        this.target?.dispose();
        this.program.dispose();
        this.resolve.dispose();
        this.gl.deleteBuffer(this.indices);
        this.gl.deleteVertexArray(this.vertexArray);
    }

    private setOrder(order: Uint32Array): void {
        const { gl } = this;
        gl.bindBuffer(gl.ARRAY_BUFFER, this.indices);
        gl.bufferData(gl.ARRAY_BUFFER, order, gl.DYNAMIC_DRAW);
        this.drawn = order.length;
        this.options.onOrder?.();
    }

    private targetOf(view: View): Target | null {
        if (!this.format) return null;
        if (this.target?.widthPx !== view.widthPx || this.target.heightPx !== view.heightPx) {
            this.target?.dispose();
            this.target = new Target(this.gl, this.format, view.widthPx, view.heightPx);
        }
        return this.target;
    }

    private scissor(view: View, part: DrawOptions['scissorPx']): void {
        const { gl } = this;
        if (!part) return gl.disable(gl.SCISSOR_TEST);
        gl.enable(gl.SCISSOR_TEST);
        gl.scissor(part[0], view.heightPx - part[1] - part[3], part[2], part[3]);
    }

    private drawSplats(view: View, info: SceneInfo, buffers: SplatBuffers, { colours = 'trained', depthRange }: DrawOptions): void {
        const { gl, program } = this;
        const [nearest, farthest] = depthRange ?? [info.near, 1000 * info.near];
        gl.useProgram(program.program);
        const u = (name: string) => program.uniform(name);
        [buffers.splats, buffers.sh, buffers.means, buffers.texels].forEach((pool, unit) => {
            gl.activeTexture(gl.TEXTURE0 + unit);
            gl.bindTexture(gl.TEXTURE_2D, pool.texture);
            gl.uniform1i(u(['splats', 'sh', 'means', 'texels'][unit]), unit);
        });
        const camera = centreOf(view);
        gl.uniformMatrix3fv(u('cameraFromData'), true, view.rotation);
        gl.uniform3f(u('translation'), ...view.translation);
        gl.uniform3f(u('cameraInData'), ...camera);
        gl.uniform2f(u('focal'), ...view.focalPx);
        gl.uniform2f(u('principal'), ...view.principalPx);
        gl.uniform2f(u('size'), view.widthPx, view.heightPx);
        gl.uniform2f(u('origin'), 0, 0);
        gl.uniform2f(u('depthFromInverse'), 0, 0);
        gl.uniform1f(u('near'), info.near);
        gl.uniform1f(u('growth'), buffers.growth);
        gl.uniform1ui(u('grown'), buffers.grown);
        gl.uniform1i(u('filtered'), info.filter === 'ewa' ? 1 : 0);
        gl.uniform1i(u('colours'), COLOURS[colours]);
        gl.uniform3fv(u('classColours'), classColours(colours));
        gl.uniform2f(u('depthRange'), Math.log(nearest), Math.log(farthest));
        gl.enable(gl.BLEND);
        const counts = Boolean(this.options.defines);
        gl.blendFunc(gl.ONE, counts ? gl.ONE : gl.ONE_MINUS_SRC_ALPHA);
        gl.bindVertexArray(this.vertexArray);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.drawn);
        gl.disable(gl.BLEND);
    }

    private resolveOntoCanvas(target: Target, info: SceneInfo): void {
        const { gl, resolve } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.useProgram(resolve.program);
        gl.activeTexture(gl.TEXTURE0);
        gl.bindTexture(gl.TEXTURE_2D, target.texture);
        gl.uniform1i(resolve.uniform('image'), 0);
        gl.uniform1i(resolve.uniform('linear'), info.colourSpace === 'lin_rec709_display' ? 1 : 0);
        gl.bindVertexArray(null);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
}
