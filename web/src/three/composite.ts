/**
 * Splats in a render target of linear light. They are blended in a target of their own, in the space that they were
 * trained in, against the depth of the bound one; then that image is laid over what is there as if that, too, were of
 * their space. So images are those of a target of display values. Converting each splat instead changes what blending
 * gives (measured on a photographed scene: 25 dB).
 */

import { BufferGeometry, type Camera, ExternalTexture, GLSL3, Mesh, NoBlending, RawShaderMaterial, type WebGLRenderer, type WebGLRenderTarget } from 'three';
import vertex from '../core/render/shaders/resolve.vert.glsl?raw';
import fragment from './composite.frag.glsl?raw';
import { OwnTarget } from './own-target';

/** Targets that are kept, for as many sizes. */
const MAX_TARGETS = 3;

// Without attributes, so that the renderer can draw it without preparing it.
const triangle = new BufferGeometry();
triangle.setDrawRange(0, 3);

export class Composite {
    private readonly targets = new Map<string, OwnTarget>();
    private readonly front = new ExternalTexture();
    private readonly back = new ExternalTexture();
    private readonly quad: Mesh<BufferGeometry, RawShaderMaterial>;
    private open: { own: OwnTarget; bound: WebGLFramebuffer } | null = null;

    constructor(private readonly renderer: WebGLRenderer) {
        const uniforms = { splats: { value: this.front }, behind: { value: this.back }, linear: { value: false } };
        this.quad = new Mesh(triangle, new RawShaderMaterial({
            name: 'LitetexComposite', glslVersion: GLSL3, vertexShader: vertex, fragmentShader: fragment, uniforms, depthTest: false, depthWrite: false, blending: NoBlending,
        }));
    }

    /** From here to `end`, what is drawn goes into a target of its own. False if that cannot be had. */
    begin(target: WebGLRenderTarget): boolean {
        // The layer of the depth that is bound cannot be told.
        if (target.depthTexture && (target.depth > 1 || (target as { isWebGLCubeRenderTarget?: boolean }).isWebGLCubeRenderTarget)) return false;
        const { state } = this.renderer;
        const gl = this.renderer.getContext() as WebGL2RenderingContext;
        const bound = gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING) as WebGLFramebuffer;
        const ask = (attachment: number, name: number) => gl.getFramebufferAttachmentParameter(gl.DRAW_FRAMEBUFFER, attachment, name);
        const depthType = ask(gl.DEPTH_ATTACHMENT, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) as number;
        const depth = depthType === gl.NONE ? null : ask(gl.DEPTH_ATTACHMENT, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_NAME) as WebGLRenderbuffer | WebGLTexture;
        const samples = Math.min(target.samples, this.renderer.capabilities.maxSamples);
        // Multisampled colours can be resolved into the same format only.
        const colour = samples > 0 ? ask(gl.COLOR_ATTACHMENT0, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_NAME) as WebGLRenderbuffer : null;
        const own = this.own(gl, target.width, target.height, samples, colour);
        if (!own.share(depth, depthType)) {
            state.bindFramebuffer(gl.FRAMEBUFFER, bound);
            return false;
        }
        state.buffers.color.setMask(true);
        gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
        this.open = { own, bound };
        return true;
    }

    /** Lays what has been drawn since `begin` over the target that was bound then. */
    end(camera: Camera, isLinear: boolean): void {
        if (!this.open) return;
        const { own, bound } = this.open;
        this.open = null;
        own.resolve(bound);
        this.front.sourceTexture = own.colours;
        this.back.sourceTexture = own.behind;
        const { material } = this.quad;
        material.uniforms.linear.value = isLinear;
        material.uniformsNeedUpdate = true;
        this.renderer.renderBufferDirect(camera, null as never, triangle, material, this.quad, null as never);
    }

    /** `alive`: whether the context still has what was made. */
    dispose(alive: boolean): void {
        for (const key of [...this.targets.keys()]) this.drop(key, alive);
        this.quad.material.dispose();
    }

    private own(gl: WebGL2RenderingContext, width: number, height: number, samples: number, colour: WebGLRenderbuffer | null): OwnTarget {
        let format: number = gl.RGBA16F;
        if (colour) {
            gl.bindRenderbuffer(gl.RENDERBUFFER, colour);
            format = gl.getRenderbufferParameter(gl.RENDERBUFFER, gl.RENDERBUFFER_INTERNAL_FORMAT) as number;
            gl.bindRenderbuffer(gl.RENDERBUFFER, null);
        }
        const key = [width, height, samples, format].join();
        let own = this.targets.get(key);
        this.targets.delete(key); // the latest used stands last
        if (!own) {
            if (this.targets.size >= MAX_TARGETS) this.drop(this.targets.keys().next().value!, true);
            own = new OwnTarget(gl, this.renderer.state, width, height, samples, format);
            this.renderer.info.memory.textures += 2;
        }
        this.targets.set(key, own);
        return own;
    }

    private drop(key: string, alive: boolean): void {
        if (alive) this.targets.get(key)!.dispose();
        this.targets.delete(key);
        this.renderer.info.memory.textures -= 2;
    }
}
