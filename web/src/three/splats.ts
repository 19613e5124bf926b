/** A scene of textured splats as an object of three.js. */

import {
    Box3, type BufferGeometry, type Camera, ColorManagement, InstancedBufferGeometry, type Intersection, LinearTransfer, type Material, Mesh, type PerspectiveCamera, type Raycaster, type Scene,
    Sphere, Vector3, Vector4, type WebGLRenderer, type WebGLRenderTarget,
} from 'three';
import { batchesOf, batchIndices } from '../core/render/batch';
import type { Colours } from '../core/render/colours';
import type { SceneCamera, SceneInfo, SplatUpdate } from '../core/scene';
import { sceneBounds } from '../viewer/bounds';
import { SplatData, type SplatsOptions } from '../guest/data';
import { CameraOrder } from '../guest/orders';
import { similarityOf, viewOfCamera } from '../guest/view';
import { pick } from '../core/pick';
import { RendererContext } from './context';
import { CONVERSION, SplatMaterial } from './material';
import { takeSceneCamera } from './view';

/** What a target holds: code values as a display takes them, or linear light. */
export type TargetColours = 'auto' | 'display' | 'linear';

/** What `Raycaster` gives for a LitetexSplats. */
export interface SplatIntersection extends Intersection<LitetexSplats> {
    /** Index of the splat, in the order of the file. */
    splatIndex: number;
    /** Alpha of that splat where the ray meets it. */
    alpha: number;
    /** Of the splat's plane, towards the ray's origin, in the world. */
    normal: Vector3;
}

/** Share of centres that the bounding box leaves out at either end of an axis. */
const OUTSIDE = 0.05;

const viewport = new Vector4();

/**
 * Draws a scene with WebGLRenderer, in its pass of transparent objects: behind opaque meshes where these are nearer, to
 * the pixel, premultiplied, without writing depth.
 *
 * The object's frame is that of the data. It may be moved, turned and scaled evenly, as may its parents; of uneven
 * scales, shear and mirroring the closest similarity is shown, with a warning. `layers`, `visible`, `renderOrder` work as
 * usual. Any number of cameras can show it in a frame; they need perspective.
 *
 * Call `dispose()` when it is no longer needed; `geometry.dispose()` does the same.
 */
export class LitetexSplats extends Mesh<InstancedBufferGeometry, SplatMaterial> {
    readonly isLitetexSplats = true;
    override type = 'LitetexSplats';
    /** What colours show: `trained` (default), `untextured`, `texels`, `degree` or `depth`. */
    colours: Colours = 'trained';
    /**
     * What the target holds. `auto`: linear light in render targets and where `outputColorSpace` is linear, as three.js's
     * own materials write it, else display values.
     */
    targetColours: TargetColours = 'auto';
    /**
     * How colours are converted if the target holds others than the scene. `image` (default): as a whole, blended in a
     * target of their own; in render targets only, not on the canvas. `splat`: each by itself, which is cheaper and
     * changes what blending gives: 25 dB on a photographed scene.
     */
    conversion: 'image' | 'splat' = 'image';
    /**
     * When orders are made. `auto`: in a worker, so that images after a turn of less than 10 degrees may show the order of
     * a few frames before; `onUpdate` tells when it has come. `immediate`: before each image, for exact ones.
     */
    sorting: 'auto' | 'immediate' = 'auto';
    /**
     * `fast` (default): splats are projected once an image, and the hardware interpolates their maps: 50 dB and more against `exact`,
     * which follows the specification, in 16 bits and more.
     */
    precision: 'exact' | 'fast' = 'fast';
    /** Called when there is something new to draw: splats that have arrived, an order of the worker. */
    onUpdate: (() => void) | null = null;
    /** Resolves when the whole file is there, rejects if the rest of it cannot be read. Set by loaders. */
    loaded: Promise<void> = Promise.resolve();
    /** Of most splats, without floaters and backdrops, in the frame of the data; null until it is computed. */
    boundingBox: Box3 | null = null;
    boundingSphere: Sphere | null = null;
    private readonly orders = new WeakMap<Camera, CameraOrder>();
    private afterRender: (() => void) | null = null;
    private readonly warnings = new Set<string>();
    private readonly changed = () => {
        this.boundingBox = this.boundingSphere = null;
        this.onUpdate?.();
    };

    /** An object without splats, which `apply` gives it; loaders do that. */
    constructor(source: SceneInfo | SplatData<RendererContext>, options: SplatsOptions = {}) {
        const geometry = new InstancedBufferGeometry();
        geometry.setIndex(batchIndices());
        geometry.instanceCount = 0;
        super(geometry, new SplatMaterial());
        this.data = source instanceof SplatData ? source : new SplatData<RendererContext>(source, options);
        this.data.retain(this, this.changed);
        // Bounds are those of most splats, not all.
        this.frustumCulled = false;
        geometry.addEventListener('dispose', () => this.release());
    }

    private readonly data: SplatData<RendererContext>;

    /** What the file says. */
    get info(): SceneInfo {
        return this.data.info;
    }

    /** Splats that have arrived. */
    get splatCount(): number {
        return this.data.count;
    }

    /** Takes splats: they replace all from the update's first on. */
    apply(update: SplatUpdate): void {
        this.data.apply(update);
    }

    /** Lets a camera without parent stand where one of `info.cameras` stood, with its lens: for images of the same aspect ratio. */
    takeCamera(camera: PerspectiveCamera, of: SceneCamera): void {
        this.updateWorldMatrix(true, false);
        takeSceneCamera(camera, of, this.matrixWorld);
    }

    override onBeforeRender(renderer: WebGLRenderer, _scene: Scene, camera: Camera, _geometry: BufferGeometry, material: Material): void {
        if (!(renderer as { isWebGLRenderer?: boolean }).isWebGLRenderer) {
            throw new Error('LitetexSplats can be drawn by WebGLRenderer only: its shaders are GLSL, which WebGPURenderer does not take');
        }
        this.geometry.instanceCount = 0;
        // An override material draws nothing.
        if ((material as unknown) !== this.material || this.data.disposed) return;
        if (renderer.state.buffers.depth.getReversed() && !camera.reversedDepth) {
            // What the renderer does to cameras a moment later.
            (camera as unknown as { _reversedDepth: boolean })._reversedDepth = true;
            (camera as PerspectiveCamera).updateProjectionMatrix();
        }
        renderer.getCurrentViewport(viewport);
        const view = viewOfCamera(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements, this.matrixWorld.elements, viewport);
        if (!view) return this.warn('LitetexSplats: cameras without perspective are not supported, and show no splats');
        if (!view.exact) this.warn('LitetexSplats: uneven scales, shear and mirroring are not supported; the closest similarity is shown');
        const { gpu, host } = this.data.gpu(renderer.state, () => new RendererContext(renderer));
        let order = this.orders.get(camera);
        if (!order) this.orders.set(camera, order = new CameraOrder());
        const r = view.rotation;
        this.data.orders.update(order, { axis: [r[6], r[7], r[8]], offset: view.translation[2] }, this.sorting === 'immediate');
        const { pool, count, stamp } = gpu.order(order);
        this.geometry.instanceCount = batchesOf(count);
        const depthRange = this.colours === 'depth' ? this.depthRange(view.cameraInData) : [1, 2] as const;
        const fast = this.precision === 'exact' ? null : gpu.prepare({
            view, info: this.info, buffers: gpu.buffers, order: pool, drawn: count, orderVersion: stamp, colours: this.colours, budget: Infinity, depthRange,
        });
        this.material.setTextures(gpu, pool, count, fast);
        const target = renderer.getRenderTarget();
        const conversion = this.conversionFor(renderer);
        const whole = conversion !== CONVERSION.none && this.conversion === 'image' && target !== null && host.composite.begin(target);
        this.afterRender = whole ? () => host.composite.end(camera, conversion === CONVERSION.toLinear) : null;
        this.material.set(view, viewport, this.info, this.colours, whole ? CONVERSION.none : conversion, depthRange);
        this.material.setLogarithmicDepth(renderer, (camera as PerspectiveCamera).far, view.scale);
    }

    override onAfterRender(): void {
        this.afterRender?.();
        this.afterRender = null;
    }

    /** Adds the surface that the ray meets: where its transmittance falls below one half. */
    override raycast(raycaster: Raycaster, intersects: Intersection[]): void {
        const { scale, rotation: r, translation: t } = similarityOf(this.matrixWorld.elements);
        const { origin, direction } = raycaster.ray;
        const turned = (x: number, y: number, z: number) => [0, 1, 2].map((c) => r[c] * x + r[3 + c] * y + r[6 + c] * z) as [number, number, number];
        const found = pick(this.data.parts, {
            origin: turned((origin.x - t[0]) / scale, (origin.y - t[1]) / scale, (origin.z - t[2]) / scale),
            direction: turned(direction.x, direction.y, direction.z),
            near: raycaster.near / scale,
            far: raycaster.far / scale,
        });
        if (!found) return;
        const distance = found.distance * scale;
        const [x, y, z] = found.normal;
        const normal = new Vector3(r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z, r[6] * x + r[7] * y + r[8] * z);
        const hit: SplatIntersection = { distance, point: raycaster.ray.at(distance, new Vector3()), object: this, normal, splatIndex: found.splat, alpha: found.alpha };
        intersects.push(hit);
    }

    /** What the file says is its bulk; else the box between the 5th and the 95th percentile of centres. In the frame of the data. */
    computeBoundingBox(): void {
        const { bounds } = this.info;
        if (bounds) {
            this.boundingBox = new Box3(new Vector3(...bounds.min), new Vector3(...bounds.max));
            return;
        }
        const positions = this.positions();
        const step = 3 * Math.max(1, Math.floor(positions.length / 60_000));
        this.boundingBox = new Box3();
        if (positions.length === 0) return;
        for (const [c, axis] of (['x', 'y', 'z'] as const).entries()) {
            const values = Float64Array.from({ length: Math.ceil(positions.length / step) }, (_, i) => positions[step * i + c]).sort();
            this.boundingBox.min[axis] = values[Math.floor(OUTSIDE * (values.length - 1))];
            this.boundingBox.max[axis] = values[Math.ceil((1 - OUTSIDE) * (values.length - 1))];
        }
    }

    /** The sphere around that box or, without bounds in the file, around nine of ten splats, in the frame of the data. three.js orders transparent objects by its centre. */
    computeBoundingSphere(): void {
        const { centre, radius } = sceneBounds(this.info, () => this.positions());
        this.boundingSphere = new Sphere(new Vector3(...centre), this.splatCount > 0 ? radius : 0);
    }

    /** Another object that shows the same splats; they are freed with the last one. */
    override clone(recursive?: boolean): this {
        return new LitetexSplats(this.data).copy(this, recursive) as this;
    }

    override copy(source: LitetexSplats, recursive?: boolean): this {
        const { geometry, material } = this;
        super.copy(source as this, recursive);
        Object.assign(this, { geometry, material });
        this.colours = source.colours;
        this.targetColours = source.targetColours;
        this.conversion = source.conversion;
        this.sorting = source.sorting;
        this.precision = source.precision;
        this.loaded = source.loaded;
        return this;
    }

    /** Frees textures, the worker and the splats themselves; nothing is drawn any more. */
    override dispose(): void {
        super.dispose();
        this.geometry.dispose();
    }

    private release(): void {
        this.material.dispose();
        this.data.release(this);
        this.geometry.instanceCount = 0;
    }

    private conversionFor(renderer: WebGLRenderer): number {
        const linear = this.targetColours === 'auto' ? holdsLinearLight(renderer) : this.targetColours === 'linear';
        const isLinear = this.info.colourSpace === 'lin_rec709_display';
        if (linear === isLinear) return CONVERSION.none;
        return linear ? CONVERSION.toLinear : CONVERSION.toSrgb;
    }

    /** Depths between which most of the scene lies. */
    private depthRange(camera: readonly number[]): [near: number, far: number] {
        if (!this.boundingSphere) this.computeBoundingSphere();
        const { center, radius } = this.boundingSphere!;
        const distance = Math.hypot(center.x - camera[0], center.y - camera[1], center.z - camera[2]);
        return [Math.max(distance - radius, 0.05 * (distance + radius)), distance + radius];
    }

    private positions(): Float32Array {
        const positions = new Float32Array(3 * this.splatCount);
        for (const { first, splats } of this.data.parts) positions.set(splats.positions.subarray(0, 3 * splats.count), 3 * first);
        return positions;
    }

    private warn(message: string): void {
        if (!this.warnings.has(message)) console.warn(message);
        this.warnings.add(message);
    }
}

/** The renderer's own rule for what materials write. */
function holdsLinearLight(renderer: WebGLRenderer): boolean {
    const target = renderer.getRenderTarget() as (WebGLRenderTarget & { isXRRenderTarget?: boolean }) | null;
    const space = !target ? renderer.outputColorSpace : target.isXRRenderTarget ? target.texture.colorSpace : ColorManagement.workingColorSpace;
    return ColorManagement.getTransfer(space) === LinearTransfer;
}
