/** Lays splats over a render target of three.js that holds light of another space than theirs. */

import { BufferGeometry, type Camera, ExternalTexture, GLSL3, Mesh, NoBlending, RawShaderMaterial, type WebGLRenderer, type WebGLRenderTarget } from 'three';
import { Overlay, OVERLAY_SHADERS } from '../guest/overlay';

// Without attributes, so that the renderer can draw it without preparing it.
const triangle = new BufferGeometry();
triangle.setDrawRange(0, 3);

export class Composite {
    private readonly overlay: Overlay;
    private readonly front = new ExternalTexture();
    private readonly back = new ExternalTexture();
    private readonly quad: Mesh<BufferGeometry, RawShaderMaterial>;

    constructor(private readonly renderer: WebGLRenderer, counted: (textures: number) => void) {
        this.overlay = new Overlay(renderer.getContext() as WebGL2RenderingContext, counted);
        const uniforms = { splats: { value: this.front }, behind: { value: this.back }, linear: { value: false } };
        this.quad = new Mesh(triangle, new RawShaderMaterial({
            name: 'LitetexComposite', glslVersion: GLSL3, vertexShader: OVERLAY_SHADERS.vertex, fragmentShader: OVERLAY_SHADERS.fragment, uniforms,
            depthTest: false, depthWrite: false, blending: NoBlending,
        }));
    }

    /** From here to `end`, what is drawn goes into a target of its own. False if that cannot be had. */
    begin(target: WebGLRenderTarget): boolean {
        // The layer of the depth that is bound cannot be told.
        if (target.depthTexture && (target.depth > 1 || (target as { isWebGLCubeRenderTarget?: boolean }).isWebGLCubeRenderTarget)) return false;
        const { state, capabilities } = this.renderer;
        state.buffers.color.setMask(true);
        return this.overlay.begin(target.width, target.height, Math.min(target.samples, capabilities.maxSamples));
    }

    /** Lays what has been drawn since `begin` over the target that was bound then. */
    end(camera: Camera, isLinear: boolean): void {
        const images = this.overlay.end();
        if (!images) return;
        this.front.sourceTexture = images.splats;
        this.back.sourceTexture = images.behind;
        const { material } = this.quad;
        material.uniforms.linear.value = isLinear;
        material.uniformsNeedUpdate = true;
        this.renderer.renderBufferDirect(camera, null as never, triangle, material, this.quad, null as never);
    }

    dispose(): void {
        this.overlay.dispose();
        this.quad.material.dispose();
    }
}
