/** A scene of textured splats in PlayCanvas. */

import {
    type AppBase, BLENDEQUATION_ADD, BLENDMODE_ONE, BLENDMODE_ONE_MINUS_SRC_ALPHA, BlendState, type CameraComponent, DepthState, Entity, FUNC_LESSEQUAL, GAMMA_NONE, type Layer, LAYERID_WORLD,
    Mat4, Quat, type RenderTarget, RENDERTARGET_ORIGIN_TOP, Vec3, VIEW_CENTER, type WebglGraphicsDevice,
} from 'playcanvas';
import type { Colours } from '../core/render/colours';
import type { Frame } from '../core/render/projection';
import type { SceneCamera, SceneInfo, SplatUpdate } from '../core/scene';
import { SplatData, type SplatsOptions } from '../guest/data';
import { CameraOrder } from '../guest/orders';
import { viewOfCamera } from '../guest/view';
import { DeviceContext } from './context';

export interface LitetexSplatsOptions extends SplatsOptions {
    /** Id of the layer whose transparent meshes are drawn after the splats. Default: the world. */
    readonly layer?: number;
}

const OVER = new BlendState(true, BLENDEQUATION_ADD, BLENDMODE_ONE, BLENDMODE_ONE_MINUS_SRC_ALPHA);
const BEHIND_MESHES = new DepthState(FUNC_LESSEQUAL, false);

/**
 * Draws a scene for each camera that shows its layer: after the opaque meshes and the sky, before the layer's transparent meshes. Opaque
 * meshes hide what is behind them, to the pixel; splats write no depth.
 *
 * Splats are sorted by depth along the camera's axis, as they were trained, in a worker. The entity may be moved, turned and scaled evenly, as
 * may its parents; of uneven scales, shear and mirroring the closest similarity is shown, with a warning.
 *
 * Call `dispose()` when it is no longer needed; destroying the entity or the app does the same.
 */
export class LitetexSplats {
    /** In the frame of the data. To be added to the hierarchy of the app, by whoever loads it. */
    readonly entity: Entity;
    /** What colours show: `trained` (default), `untextured`, `texels` or `degree`. */
    colours: Exclude<Colours, 'depth'> = 'trained';
    /**
     * When orders are made. `auto`: in a worker, so that images after a turn of less than 10 degrees may show the order of
     * a few frames before. `immediate`: before each image, for exact ones.
     */
    sorting: 'auto' | 'immediate' = 'auto';
    /** Resolves when the whole file is there, rejects if the rest of it cannot be read. Set by `loadSplats`. */
    loaded: Promise<void> = Promise.resolve();
    private readonly data: SplatData<DeviceContext>;
    private readonly device: WebglGraphicsDevice;
    private readonly layer: number;
    private readonly orders = new WeakMap<CameraComponent, CameraOrder>();
    private readonly handles: { off(): void }[];
    private readonly warnings = new Set<string>();
    private context: DeviceContext | null = null;

    /** An object without splats, which `apply` gives it; `loadSplats` does that. */
    constructor(private readonly app: AppBase, info: SceneInfo, options: LitetexSplatsOptions = {}) {
        const { graphicsDevice: device } = app;
        if (!device.isWebGL2) throw new Error(`litetex/playcanvas draws with WebGL2, and this device is ${device.deviceType}: create it with deviceTypes: ['webgl2']`);
        this.device = device as WebglGraphicsDevice;
        this.layer = options.layer ?? LAYERID_WORLD;
        this.data = new SplatData<DeviceContext>(info, options);
        this.data.retain(this, () => { app.renderNextFrame = true; });
        this.entity = new Entity(info.provenance.title || 'Splats', app);
        const world = new Mat4().set([...info.worldFromData]);
        this.entity.setLocalPosition(world.getTranslation());
        this.entity.setLocalRotation(new Quat().setFromMat4(world));
        this.entity.setLocalScale(world.getScale());
        this.handles = [
            app.scene.on('prerender:layer', this.draw, this),
            device.on('devicelost', this.forget, this),
            this.entity.once('destroy', this.release, this),
            app.once('destroy', this.release, this),
        ];
    }

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

    /**
     * Lets a camera stand where one of `info.cameras` stood, with its lens, which `calculateProjection` then gives: for images of the
     * same aspect ratio.
     */
    takeCamera(camera: Entity, { rotation: r, translation: t, focalPx, principalPx, widthPx, heightPx }: SceneCamera): void {
        const cameraFromData = new Mat4().set([r[0], -r[3], -r[6], 0, r[1], -r[4], -r[7], 0, r[2], -r[5], -r[8], 0, t[0], -t[1], -t[2], 1]);
        const worldFromCamera = new Mat4().mul2(this.entity.getWorldTransform(), cameraFromData.invert());
        camera.setPosition(worldFromCamera.getTranslation());
        camera.setRotation(new Quat().setFromMat4(worldFromCamera));
        const lens = camera.camera!;
        lens.fov = 2 * Math.atan(0.5 * heightPx / focalPx[1]) * 180 / Math.PI;
        lens.calculateProjection = (projection: Mat4) => {
            const { nearClip: near, farClip: far } = lens;
            projection.set([
                2 * focalPx[0] / widthPx, 0, 0, 0, 0, 2 * focalPx[1] / heightPx, 0, 0, 1 - 2 * principalPx[0] / widthPx, 2 * principalPx[1] / heightPx - 1, (far + near) / (near - far), -1,
                0, 0, 2 * far * near / (near - far), 0,
            ]);
        };
    }

    /** Frees textures, the worker and the splats themselves, and destroys the entity. */
    dispose(): void {
        if (this.data.disposed) return;
        this.release();
        this.entity.destroy();
    }

    private release(): void {
        this.data.release(this);
        this.handles.forEach((handle) => handle.off());
    }

    /** Everything that was in the context has gone with it. */
    private forget(): void {
        if (this.context) this.context.lost = true;
        this.context = null;
    }

    private draw(camera: CameraComponent, layer: Layer, isTransparent: boolean): void {
        const { device, data, info } = this;
        if (layer.id !== this.layer || !isTransparent || !this.entity.enabled) return;
        const { gl } = device;
        if (gl.isContextLost()) return;
        if (this.app.xr?.active) return this.warn('LitetexSplats: XR is not supported, and shows no splats');
        const target = device.getRenderTarget();
        const viewport = partOf(target, camera.rect);
        const projection = [...camera.projectionMatrix.data];
        if (target.origin === RENDERTARGET_ORIGIN_TOP) for (const i of [1, 5, 9, 13]) projection[i] *= -1;
        const view = viewOfCamera(projection, cameraFromWorld(camera).data, this.entity.getWorldTransform().data, viewport);
        if (!view) return this.warn('LitetexSplats: cameras without perspective are not supported, and show no splats');
        if (!view.exact) this.warn('LitetexSplats: uneven scales, shear and mirroring are not supported; the closest similarity is shown');

        this.context ??= new DeviceContext(gl);
        const context = this.context;
        const { gpu } = data.gpu(context, () => context);
        let order = this.orders.get(camera);
        if (!order) this.orders.set(camera, order = new CameraOrder());
        const r = view.rotation;
        data.orders.update(order, { axis: [r[6], r[7], r[8]], offset: view.translation[2] }, this.sorting === 'immediate');
        const { pool, count, stamp } = gpu.order(order);
        if (count === 0) return;

        // What is not for the screen holds linear light until it is corrected.
        const isLinear = camera.gammaCorrection === GAMMA_NONE;
        const isOther = isLinear !== (info.colourSpace === 'lin_rec709_display');
        const frame: Frame = {
            view, info, buffers: gpu.buffers, order: pool, drawn: count, orderVersion: stamp, colours: this.colours, budget: Infinity, depthRange: [1, 2],
            depth: { fromInverse: view.depthFromInverse, slope: view.depthSlope },
        };
        const path = gpu.prepare(frame);
        device.setDrawStates(OVER, BEHIND_MESHES);
        device.setViewport(viewport.x, viewport.y, viewport.width, viewport.height);
        const scissor = partOf(target, camera.scissorRect);
        device.setScissor(scissor.x, scissor.y, scissor.width, scissor.height);
        const isOverlaid = isOther && context.overlay.begin(target.width, target.height, target.samples > 1 ? target.samples : 0);
        context.drawing(() => path.draw({ ...frame, conversion: isOverlaid || !isOther ? null : isLinear ? 'TO_LINEAR' : 'TO_SRGB' }));
        if (!isOverlaid) return;
        device.setDrawStates();
        context.endOverlay(isLinear);
    }

    private warn(message: string): void {
        if (!this.warnings.has(message)) console.warn(message);
        this.warnings.add(message);
    }
}

/** The pixels of a part of a target that is given in shares of it, as PlayCanvas rounds them. */
function partOf({ width, height }: RenderTarget, { x, y, z, w }: { x: number; y: number; z: number; w: number }) {
    return { x: Math.floor(x * width), y: Math.floor(y * height), width: Math.floor(z * width), height: Math.floor(w * height) };
}

function cameraFromWorld({ entity, calculateTransform }: CameraComponent): Mat4 {
    const worldFromCamera = new Mat4();
    if (calculateTransform) calculateTransform(worldFromCamera, VIEW_CENTER);
    else worldFromCamera.setTRS(entity.getPosition(), entity.getRotation(), Vec3.ONE);
    return worldFromCamera.invert();
}
