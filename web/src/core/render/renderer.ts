/** Draws a scene with WebGL2, into a target of 16 bits and from there onto the canvas. */

import type { SceneInfo, Splats, SplatUpdate } from '../scene';
import { Batches } from './batch';
import { SplatBuffers, type Storage } from './buffers';
import type { Colours } from './colours';
import { ExactPath } from './exact';
import { FastPath } from './fast';
import { Loss } from './loss';
import { Order } from './order';
import { Pool } from './pool';
import { type Program, resolveProgram } from './program';
import type { Frame } from './projection';
import { StandIn } from './stand-in';
import { bestTarget, Target, type TargetFormat } from './targets';
import type { View } from './view';

export interface RendererOptions {
    /** Bits of colours and texels on the GPU. Default: half. */
    storage?: Storage;
    /** What images are blended in. Default: 16 bits where the device can, else `canvas`: the canvas's 8 bits. */
    target?: TargetFormat | 'canvas';
    /** Called when another order is there, so that an image should be drawn. */
    onOrder?: () => void;
    /** Called when the browser has taken the context away, as of tabs in the background: the canvas is empty, and `draw` does nothing. */
    onLost?: () => void;
    /** Called when it is there again, without splats: `start` and `apply` must give them once more, as `Opened.again` does. */
    onRestored?: () => void;
    /** Shows at most this many splats, those that contribute most: for weak devices. */
    maxSplats?: number;
    /** For measurements: what stands before the fragment shader, `#define COUNT_FRAGMENTS` or `#define COUNT_DRAWN`. */
    defines?: string;
}

export interface DrawOptions {
    /**
     * `exact` (default): as the specification says, in 16 bits and more. `fast`: half to two thirds of the time; maps of 8 bits are
     * interpolated by the hardware.
     */
    precision?: 'exact' | 'fast';
    /** Blends on the canvas itself, in its 8 bits, as of a moving camera; not in linear light. Default: in the renderer's target. */
    onCanvas?: boolean;
    /** Draws at most this many splats, the first ones, which contribute most; they are grown to cover what is missing. */
    maxSplats?: number;
    /** Draws the stand-in of the scene, if it has one: from afar, and on weak devices. Until the scene looks better, it is drawn anyhow. */
    standIn?: boolean;
    colours?: Colours;
    /** Behind the splats, in the colour space of the scene; null: transparent. Default: that of the scene. */
    background?: readonly [number, number, number] | null;
    /** Depths that are shown as white and black where colours show depth, units of the data. */
    depthRange?: readonly [near: number, far: number];
    /** Part of the image to draw, px from the upper left corner: the rest of the canvas is kept. */
    scissorPx?: readonly [x: number, y: number, width: number, height: number];
}

/** What the context holds besides the scene. */
interface Tools {
    readonly order: Order;
    readonly batches: Batches;
    readonly exact: ExactPath;
    readonly fast: FastPath;
    readonly resolve: Program;
    readonly format: TargetFormat | null;
}

export class SplatRenderer {
    readonly gl: WebGL2RenderingContext;
    info: SceneInfo | null = null;
    /** Null while the context is lost. */
    private tools: Tools | null = null;
    private buffers: SplatBuffers | null = null;
    /** Splats far to near. */
    private ordered: Pool | null = null;
    private target: Target | null = null;
    private drawn = 0;
    private orderVersion = 0;
    private standIn: StandIn | null = null;
    /** So much of the scene has arrived that it looks better than the stand-in. */
    private hasArrived = false;
    /** It is in order, too, and is shown. */
    private hasReplaced = false;
    /** Of the scene before the context was lost. */
    private before = { splats: 0, texels: 0, bytes: 0, sortMs: 0 };
    private readonly loss: Loss;

    constructor(readonly canvas: HTMLCanvasElement | OffscreenCanvas, private readonly options: RendererOptions = {}) {
        const gl = canvas.getContext('webgl2', { antialias: false, depth: false, premultipliedAlpha: true, powerPreference: 'high-performance' });
        if (!gl) throw new Error('this browser has no WebGL2');
        this.gl = gl as WebGL2RenderingContext;
        this.loss = new Loss(this.gl, () => this.drop(), () => {
            this.tools = this.make();
            options.onRestored?.();
        });
        if (!this.gl.isContextLost()) this.tools = this.make();
    }

    /** Whether there is no context: nothing is drawn, and splats that are given are dropped. */
    get lost(): boolean {
        return !this.tools || this.gl.isContextLost();
    }

    /** Gives the context up: browsers allow few on a page. The canvas is empty until `retake` has brought it back. */
    release(): void {
        this.loss.release();
        if (this.gl.isContextLost()) this.drop();
    }

    /** Asks for the context again; `onRestored` tells when it is there. */
    retake(): void {
        this.loss.retake();
    }

    /** Begins a scene; the one before is dropped. */
    start(info: SceneInfo): void {
        this.info = info;
        if (!this.tools) return;
        if (this.buffers) this.tools.fast.forget(this.buffers);
        this.buffers?.dispose();
        this.ordered?.dispose();
        this.buffers = new SplatBuffers(this.gl, info, this.options.storage ?? 'half', this.options.maxSplats);
        this.ordered = new Pool(this.gl, 'r32ui', this.buffers.capacity);
        this.drawn = 0;
        this.dropStandIn();
        this.hasArrived = this.hasReplaced = info.standInUntil === null;
        this.tools.order.setPositions(0, new Float32Array(0));
    }

    /** Takes the stand-in of the scene. */
    setStandIn(splats: Splats): void {
        if (!this.tools || !this.info || splats.count > (this.options.maxSplats ?? Infinity)) return;
        this.dropStandIn();
        this.standIn = new StandIn(this.gl, this.info, splats, this.options.storage ?? 'half');
    }

    /** Whether the scene has a stand-in. */
    get hasStandIn(): boolean {
        return this.standIn !== null;
    }

    /** Takes splats as they arrive. Those of before are drawn until the next order is there. */
    apply(update: SplatUpdate): void {
        if (!this.tools) return;
        const kept = this.buffers!.apply(update);
        // Where fewer splats are wanted, the file ends before.
        const isAll = update.complete && this.buffers!.count === this.buffers!.capacity;
        this.hasArrived ||= isAll || update.bytes >= this.info!.standInUntil!;
        this.tools.order.setPositions(update.first, update.splats.positions.subarray(0, 3 * kept));
    }

    /** Centres of the splats that are there: x, y, z of each. */
    get centres(): Float32Array {
        return this.tools?.order.centres ?? new Float32Array(0);
    }

    /** Splats and texels on the GPU, bytes of its memory, milliseconds of the last sort. */
    get figures(): { splats: number; texels: number; bytes: number; sortMs: number } {
        const { tools, buffers } = this;
        if (!tools || !buffers) return this.before;
        return { splats: buffers.count, texels: buffers.numTexels, bytes: buffers.bytes + this.ordered!.bytes + tools.fast.bytes + (this.standIn?.bytes ?? 0), sortMs: tools.order.lastMs };
    }

    /** Asks for the splats' order in a view, and waits until it is there. */
    async sorted(view: View): Promise<void> {
        this.tools?.order.request(view);
        await this.tools?.order.settled();
    }

    /** Draws with the order that is there, and asks for the right one if that is of another direction. */
    draw(view: View, options: DrawOptions = {}): void {
        const { gl, info, buffers, tools } = this;
        if (!info || !buffers || !tools || gl.isContextLost()) return;
        tools.order.request(view);
        const frame: Frame = {
            view, info, ...this.shown(view, buffers, options),
            colours: options.colours ?? 'trained', depthRange: options.depthRange ?? [info.near, 1000 * info.near],
        };
        // Before the first order there is nothing to make records of.
        const path = options.precision === 'fast' && frame.drawn > 0 ? tools.fast : tools.exact;
        if (path === tools.fast) tools.fast.prepare(frame);
        const onCanvas = options.onCanvas && info.colourSpace !== 'lin_rec709_display';
        const target = onCanvas ? null : this.targetOf(view, tools.format);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target?.framebuffer ?? null);
        gl.viewport(0, 0, view.widthPx, view.heightPx);
        this.scissor(view, options.scissorPx);
        const background = options.background === undefined ? info.background : options.background;
        gl.clearColor(...(background ?? [0, 0, 0] as const), background ? 1 : 0);
        gl.clear(gl.COLOR_BUFFER_BIT);
        gl.enable(gl.BLEND);
        gl.blendFunc(gl.ONE, this.options.defines ? gl.ONE : gl.ONE_MINUS_SRC_ALPHA);
        path.draw(frame);
        gl.disable(gl.BLEND);
        if (target) this.resolveOntoCanvas(target, info, tools.resolve);
    }

    /** The image last drawn, before it became one of 8 bits: premultiplied RGBA, rows from the top. */
    read(): Float32Array {
        if (!this.target) throw new Error('nothing is drawn into a target of floats');
        return this.target.read();
    }

    dispose(): void {
        this.loss.dispose();
        this.buffers?.dispose();
        this.ordered?.dispose();
        this.standIn?.dispose();
        this.target?.dispose();
        if (this.tools) {
            const { order, batches, exact, fast, resolve } = this.tools;
            order.dispose();
            for (const made of [batches, exact, fast, resolve]) made.dispose();
        }
    }

    private make(): Tools {
        const { gl, options } = this;
        const best = bestTarget(gl); // also allows targets of floats that options ask for
        const format = options.target === 'canvas' ? null : options.target ?? best;
        if (format === 'rgba32f') gl.getExtension('EXT_float_blend');
        const batches = new Batches(gl), fast = new FastPath(gl, batches);
        fast.compile();
        return {
            order: new Order((made) => this.setOrder(made)), batches, exact: new ExactPath(gl, batches, options.defines ?? ''),
            fast, resolve: resolveProgram(gl), format,
        };
    }

    /** Everything that was in the context has gone with it. */
    private drop(): void {
        if (!this.tools) return;
        this.options.onLost?.();
        this.before = { ...this.figures, bytes: 0 };
        this.tools.order.dispose();
        this.tools = this.buffers = this.ordered = this.target = this.standIn = null;
        this.drawn = 0;
    }

    /** The splats of an image, in the order of its view. */
    private shown(view: View, buffers: SplatBuffers, { standIn, maxSplats = Infinity }: DrawOptions): Pick<Frame, 'buffers' | 'order' | 'drawn' | 'orderVersion' | 'budget'> {
        const { ordered, drawn, orderVersion, standIn: other } = this;
        if (!other || (this.hasReplaced && !standIn)) return { buffers, order: ordered!, drawn, orderVersion, budget: maxSplats };
        other.sort(view);
        return { buffers: other.buffers, order: other.order, drawn: other.buffers.count, orderVersion: other.orderVersion, budget: Infinity };
    }

    private dropStandIn(): void {
        if (this.standIn) this.tools?.fast.forget(this.standIn.buffers);
        this.standIn?.dispose();
        this.standIn = null;
    }

    private setOrder(order: Uint32Array): void {
        this.ordered?.write(0, order);
        this.drawn = order.length;
        this.hasReplaced ||= this.hasArrived;
        this.orderVersion++;
        this.options.onOrder?.();
    }

    private targetOf(view: View, format: TargetFormat | null): Target | null {
        if (!format) return null;
        if (this.target?.widthPx !== view.widthPx || this.target.heightPx !== view.heightPx) {
            this.target?.dispose();
            this.target = new Target(this.gl, format, view.widthPx, view.heightPx);
        }
        return this.target;
    }

    private scissor(view: View, part: DrawOptions['scissorPx']): void {
        const { gl } = this;
        if (!part) return gl.disable(gl.SCISSOR_TEST);
        gl.enable(gl.SCISSOR_TEST);
        gl.scissor(part[0], view.heightPx - part[1] - part[3], part[2], part[3]);
    }

    private resolveOntoCanvas(target: Target, info: SceneInfo, resolve: Program): void {
        const { gl } = this;
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.useProgram(resolve.program);
        resolve.textures({ image: target.texture });
        gl.uniform1i(resolve.uniform('linear'), info.colourSpace === 'lin_rec709_display' ? 1 : 0);
        gl.bindVertexArray(null);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
}
