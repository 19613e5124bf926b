/** The core's shaders as a material of three.js. */

import { CustomBlending, DoubleSide, ExternalTexture, GLSL3, Matrix3, OneFactor, OneMinusSrcAlphaFactor, RawShaderMaterial, Vector2, Vector3, type WebGLRenderer } from 'three';
import { classColours, COLOURS, type Colours } from '../core/render/colours';
import type { FastPath } from '../core/render/fast';
import type { Pool } from '../core/render/pool';
import { QUAD_SHADERS, SPLAT_SHADERS } from '../core/render/program';
import { ALL } from '../core/render/projection';
import type { SceneInfo } from '../core/scene';
import type { GpuScene } from '../guest/gpu';
import type { SplatView, Viewport } from '../guest/view';

export const CONVERSION = { none: 0, toLinear: 1, toSrgb: 2 } as const;

const TEXTURES = ['splats', 'sh', 'means', 'texels', 'order', 'place', 'falloff', 'shape', 'paint', 'places', 'atlas'] as const;

export class SplatMaterial extends RawShaderMaterial {
    private readonly textures = Object.fromEntries(TEXTURES.map((name) => [name, new ExternalTexture()])) as Record<typeof TEXTURES[number], ExternalTexture>;
    private shown: Colours | null = null;

    constructor() {
        super({
            name: 'LitetexSplats',
            glslVersion: GLSL3,
            vertexShader: SPLAT_SHADERS.vertex,
            fragmentShader: SPLAT_SHADERS.fragment,
            transparent: true,
            blending: CustomBlending,
            blendSrc: OneFactor,
            blendDst: OneMinusSrcAlphaFactor,
            premultipliedAlpha: true,
            depthTest: true,
            depthWrite: false,
            side: DoubleSide,
            forceSinglePass: true,
            toneMapped: false,
        });
        const vectors = ['focal', 'principal', 'size', 'origin', 'depthFromInverse', 'depthSlope', 'depthRange', 'logDepth', 'atlasSize'];
        this.uniforms = {
            ...Object.fromEntries(Object.entries(this.textures).map(([name, texture]) => [name, { value: texture }])),
            ...Object.fromEntries(vectors.map((name) => [name, { value: new Vector2() }])),
            cameraFromData: { value: new Matrix3() },
            translation: { value: new Vector3() },
            cameraInData: { value: new Vector3() },
            near: { value: 0 },
            growth: { value: 1 },
            grown: { value: 0 },
            filtered: { value: false },
            drawn: { value: 0 },
            budget: { value: ALL },
            colours: { value: 0 },
            classColours: { value: classColours('trained') },
        };
    }

    /** Prepares to draw `view` into a part of the target. `depths`: those that are white and black where colours show depth. */
    set(view: SplatView, { x, y }: Viewport, info: SceneInfo, colours: Colours, conversion: number, depths: readonly [number, number]): void {
        const u = this.uniforms;
        const r = view.rotation;
        (u.cameraFromData.value as Matrix3).set(r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]);
        u.translation.value.fromArray(view.translation);
        u.cameraInData.value.fromArray(view.cameraInData);
        u.focal.value.fromArray(view.focalPx);
        u.principal.value.fromArray(view.principalPx);
        u.size.value.set(view.widthPx, view.heightPx);
        u.origin.value.set(x, y);
        u.depthFromInverse.value.fromArray(view.depthFromInverse);
        u.depthSlope.value.fromArray(view.depthSlope);
        u.depthRange.value.set(Math.log(depths[0]), Math.log(depths[1]));
        u.near.value = info.near;
        u.filtered.value = info.filter === 'ewa';
        u.colours.value = COLOURS[colours];
        if (colours !== this.shown) u.classColours.value = classColours(colours);
        this.shown = colours;
        this.define('SHOWS_DEPTH', colours === 'depth');
        this.define('TO_LINEAR', conversion === CONVERSION.toLinear);
        this.define('TO_SRGB', conversion === CONVERSION.toSrgb);
        this.uniformsNeedUpdate = true;
    }

    /** Takes the textures and the number of splats of the order; those of the fast path, if it is to draw. */
    setTextures({ buffers }: GpuScene, order: Pool, drawn: number, fast: FastPath | null): void {
        const { vertex, fragment } = fast ? QUAD_SHADERS : SPLAT_SHADERS;
        if (this.vertexShader !== vertex) {
            Object.assign(this, { vertexShader: vertex, fragmentShader: fragment });
            this.needsUpdate = true;
        }
        this.define('EXACT_DEPTH', fast !== null);
        this.uniforms.drawn.value = drawn;
        this.uniforms.growth.value = buffers.growth;
        this.uniforms.grown.value = buffers.grown;
        for (const name of ['splats', 'sh', 'means', 'texels'] as const) this.textures[name].sourceTexture = buffers[name].texture;
        this.textures.order.sourceTexture = order.texture;
        if (!fast) return;
        for (const [name, texture] of Object.entries(fast.textures)) this.textures[name as keyof FastPath['textures']].sourceTexture = texture;
        this.uniforms.atlasSize.value.set(...fast.atlasSize);
    }

    /** As three.js's materials write depth if the renderer has a logarithmic one. Call it before the first image, too. */
    setLogarithmicDepth(renderer: WebGLRenderer, far: number, scale: number): void {
        this.define('LOGARITHMIC_DEPTH', renderer.capabilities.logarithmicDepthBuffer);
        this.uniforms.logDepth.value.set(1 / Math.log2(far + 1), scale);
    }

    /** Chooses a variant of the shaders. */
    private define(name: string, on: boolean): void {
        if (on === name in this.defines) return;
        if (on) this.defines[name] = 1;
        else delete this.defines[name];
        this.needsUpdate = true;
    }
}
