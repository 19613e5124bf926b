/** Draws scenes with PlayCanvas and hands the images to the tests. */

import {
    AppBase, Application, BLEND_NORMAL, CameraComponentSystem, CameraFrame, Color, createGraphicsDevice, CULLFACE_NONE, AppOptions, Entity, FILLMODE_NONE, FILTER_NEAREST, GAMMA_NONE, LAYERID_IMMEDIATE, LAYERID_UI, LAYERID_WORLD,
    Layer, type Mat4, PIXELFORMAT_RGBA16F, PIXELFORMAT_RGBA8, PROJECTION_ORTHOGRAPHIC, RenderTarget, RENDERTARGET_ORIGIN_NATIVE, RENDERTARGET_ORIGIN_TOP, RESOLUTION_FIXED, StandardMaterial, Texture, TONEMAP_NONE, Vec2, Vec3, Vec4, type WebglGraphicsDevice,
} from 'playcanvas';
import { openScene } from '../../src/core/open';
import type { SceneCamera, SceneInfo } from '../../src/core/scene';
import type { CameraOrder } from '../../src/guest/orders';
import { LitetexSplats, loadSplats } from '../../src/playcanvas';
import { discOf, infoOf, loseAndRestore } from './disc';

export interface Image {
    width: number;
    height: number;
    /** RGB as display values, f32, rows from the top. */
    rgb: string;
}

/** What is drawn into. `linear`: a target of 16 bits that holds linear light; `frame`: the target of a CameraFrame, which then goes to the canvas. */
export type How = 'canvas' | 'antialiased' | 'target' | 'flipped' | 'linear' | 'linear-multisampled' | 'frame' | 'frame-depth';

export interface Shot {
    url: string;
    view: string;
    /** Default: the canvas. */
    how?: How;
    colours?: LitetexSplats['colours'];
    /** Under a parent that is moved, turned and scaled. */
    parent?: boolean;
    /** After the loss of the context. */
    restored?: boolean;
    /** A mesh of this colour, by default the background's, over the whole image: behind all splats or before them. */
    mesh?: { colour?: readonly number[]; distance: number };
    control?: 'reversed' | 'mirrored';
}

interface Stage {
    app: AppBase;
    gl: WebGL2RenderingContext;
    camera: Entity;
    draw(): void;
}

function stage(width: number, height: number, background: readonly number[] = [0, 0, 0], antialias = false): Stage {
    const canvas = document.createElement('canvas');
    document.body.append(canvas);
    const app = new Application(canvas, { graphicsDeviceOptions: { antialias, preserveDrawingBuffer: true } });
    app.setCanvasFillMode(FILLMODE_NONE, width, height);
    app.setCanvasResolution(RESOLUTION_FIXED, width, height);
    app.autoRender = false;
    app.start();
    const camera = new Entity('camera', app);
    camera.addComponent('camera', { clearColor: new Color(background[0], background[1], background[2], 1), nearClip: 1e-3, farClip: 1e5, toneMapping: TONEMAP_NONE });
    app.root.addChild(camera);
    const { gl } = app.graphicsDevice as WebglGraphicsDevice;
    return { app, gl, camera, draw: () => app.render() };
}

function end({ app, gl }: Stage): void {
    const error = gl.getError();
    if (error) throw new Error(`WebGL error ${error}`);
    const { canvas } = app.graphicsDevice;
    app.destroy();
    canvas.remove();
}

async function load(app: AppBase, url: string, options = {}): Promise<LitetexSplats> {
    const splats = await loadSplats(app, url, options);
    await splats.loaded;
    splats.sorting = 'immediate';
    app.root.addChild(splats.entity);
    return splats;
}

const infos = new Map<string, Promise<SceneInfo>>();

/** What a file says. */
function read(url: string): Promise<SceneInfo> {
    const known = infos.get(url) ?? new Promise((resolve, reject) => { openScene({ url }, resolve, () => {}).done.catch(reject); });
    infos.set(url, known);
    return known;
}

function cameraOf(info: SceneInfo, name: string): SceneCamera {
    return info.cameras.find((camera) => camera.name.startsWith(name))!;
}

function material(colour: readonly number[], map?: Texture): StandardMaterial {
    const made = new StandardMaterial();
    Object.assign(made, { useLighting: false, useFog: false, useSkybox: false, cull: CULLFACE_NONE, emissive: new Color(colour[0], colour[1], colour[2]) });
    if (map) Object.assign(made, { emissiveMap: map, emissiveMapTiling: new Vec2(24, 24) });
    made.update();
    return made;
}

/** A plane that faces the camera and fills its image. */
function plane({ app, camera }: Stage, made: StandardMaterial, distance: number, layers: number[] = [LAYERID_WORLD]): Entity {
    const mesh = new Entity('mesh', app);
    mesh.addComponent('render', { type: 'plane', layers, material: made });
    mesh.setLocalPosition(0, 0, -distance);
    mesh.setLocalEulerAngles(90, 0, 0);
    mesh.setLocalScale(new Vec3(20 * distance, 1, 20 * distance));
    camera.addChild(mesh);
    return mesh;
}

/** Display values, rows from the top; of linear light, as PlayCanvas makes them. */
function packed(rgba: Float32Array, width: number, height: number, isLinear = false, isTopDown = false): Image {
    const rgb = new Float32Array(3 * width * height);
    for (let i = 0; i < rgb.length; i++) {
        const [pixel, c] = [Math.floor(i / 3), i % 3];
        const row = Math.floor(pixel / width);
        const value = rgba[4 * ((isTopDown ? row : height - 1 - row) * width + pixel % width) + c];
        rgb[i] = isLinear ? Math.max(0, value) ** (1 / 2.2) : value;
    }
    const bytes = new Uint8Array(rgb.buffer);
    let text = '';
    for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
    return { width, height, rgb: btoa(text) };
}

function canvasPixels(gl: WebGL2RenderingContext, width: number, height: number, x = 0): Float32Array {
    const bytes = new Uint8Array(4 * width * height);
    const bound = gl.getParameter(gl.FRAMEBUFFER_BINDING) as WebGLFramebuffer | null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(x, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.bindFramebuffer(gl.FRAMEBUFFER, bound);
    return Float32Array.from(bytes, (byte) => byte / 255);
}

function floatOfHalf(half: number): number {
    const [sign, exponent, fraction] = [half >> 15 ? -1 : 1, half >> 10 & 31, half & 1023];
    return sign * (exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * fraction / 1024);
}

/** Draws into what `how` says, and reads the image back. */
async function drawn(scene: Stage, width: number, height: number, how: How): Promise<Image> {
    const { app, gl, camera } = scene;
    const lens = camera.camera!;
    // Twice: what the first image leaves in the state is wrong in the second, if at all.
    const twice = () => { for (let i = 0; i < 2; i++) scene.draw(); };
    if (how === 'canvas' || how === 'antialiased') {
        twice();
        return packed(canvasPixels(gl, width, height), width, height);
    }
    if (how.startsWith('frame')) {
        const frame = new CameraFrame(app, lens);
        frame.rendering.toneMapping = TONEMAP_NONE;
        // Depth of field wants the depth as a second attachment of the target, or in a pass of its own.
        if (how === 'frame-depth') Object.assign(frame.dof, { enabled: true, focusRange: 1e5, focusDistance: 0 });
        frame.update();
        twice();
        const image = packed(canvasPixels(gl, width, height), width, height);
        frame.destroy();
        return image;
    }
    const isLinear = how.startsWith('linear');
    const colorBuffer = new Texture(app.graphicsDevice, { width, height, format: PIXELFORMAT_RGBA16F, mipmaps: false, minFilter: FILTER_NEAREST, magFilter: FILTER_NEAREST });
    const target = new RenderTarget({ colorBuffer, depth: true, samples: how === 'linear-multisampled' ? 4 : 1, origin: how === 'flipped' ? RENDERTARGET_ORIGIN_TOP : RENDERTARGET_ORIGIN_NATIVE });
    lens.renderTarget = target;
    if (isLinear) lens.gammaCorrection = GAMMA_NONE;
    twice();
    const halves = await colorBuffer.read(0, 0, width, height) as Uint16Array;
    Object.assign(lens, { renderTarget: null }); // which the engine allows, and its types do not
    target.destroyTextureBuffers();
    target.destroy();
    return packed(Float32Array.from(halves, floatOfHalf), width, height, isLinear, how === 'flipped');
}

const scenarios = {
    async image(shot: Shot): Promise<Image> {
        const info = await read(shot.url);
        const of = cameraOf(info, shot.view);
        const how = shot.how ?? 'canvas';
        const scene = stage(of.widthPx, of.heightPx, info.background, how === 'antialiased');
        const { app, camera, gl } = scene;
        const splats = await load(app, shot.url);
        if (shot.parent) {
            const parent = new Entity('parent', app);
            parent.setLocalPosition(5, -3, 2);
            parent.setLocalEulerAngles(30, -70, 120);
            parent.setLocalScale(3.7, 3.7, 3.7);
            app.root.addChild(parent);
            parent.addChild(splats.entity);
        }
        if (shot.colours) splats.colours = shot.colours;
        splats.takeCamera(camera, of);
        if (shot.control === 'mirrored') {
            const { calculateProjection } = camera.camera!;
            camera.camera!.calculateProjection = (projection: Mat4, view) => {
                calculateProjection(projection, view as never);
                projection.data[0] *= -1;
            };
        }
        if (shot.control === 'reversed') {
            const orders = Reflect.get(Reflect.get(splats, 'data'), 'orders') as { update(order: CameraOrder, view: object, immediate: boolean): void };
            const update = orders.update.bind(orders);
            orders.update = (order, view) => {
                const { version } = order;
                update(order, view, true);
                if (order.version !== version) order.order.reverse();
            };
        }
        if (shot.mesh) plane(scene, material(shot.mesh.colour ?? info.background), shot.mesh.distance);
        if (shot.restored) {
            scene.draw();
            await loseAndRestore(gl, scene.draw);
        }
        const image = await drawn(scene, of.widthPx, of.heightPx, how);
        end(scene);
        return image;
    },

    /** Two cameras side by side in one frame. */
    async pair(url: string, views: [string, string]): Promise<Image[]> {
        const info = await read(url);
        const cameras = views.map((name) => cameraOf(info, name));
        const widths = cameras.map((camera) => camera.widthPx);
        const [width, height] = [widths[0] + widths[1], Math.max(...cameras.map((camera) => camera.heightPx))];
        const scene = stage(width, height, info.background);
        const { app, gl, camera: first } = scene;
        const splats = await load(app, url);
        splats.sorting = 'auto';
        const second = first.clone() as Entity;
        app.root.addChild(second);
        [first, second].forEach((camera, i) => {
            camera.camera!.rect = new Vec4(i * widths[0] / width, 0, widths[i] / width, cameras[i].heightPx / height);
            splats.takeCamera(camera, cameras[i]);
        });
        for (let i = 0; i < 2; i++) scene.draw();
        const images = cameras.map((of, i) => packed(canvasPixels(gl, of.widthPx, of.heightPx, i * widths[0]), of.widthPx, of.heightPx));
        end(scene);
        return images;
    },

    /** After a small turn an image has the order of before; once the worker has made the right one, that. */
    async turned(url: string, view: string): Promise<{ before: Image; after: Image; exact: Image }> {
        const info = await read(url);
        const of = cameraOf(info, view);
        const scene = stage(of.widthPx, of.heightPx, info.background);
        const { app, camera } = scene;
        const splats = await load(app, url);
        splats.takeCamera(camera, of);
        camera.rotateLocal(0, 8, 0);
        scene.draw();
        splats.takeCamera(camera, of);
        splats.sorting = 'auto';
        const shown = () => drawn(scene, of.widthPx, of.heightPx, 'canvas');
        const before = await shown();
        app.renderNextFrame = false;
        await new Promise((resolve) => app.once('postrender', resolve));
        const after = await shown();
        splats.sorting = 'immediate';
        const exact = await shown();
        end(scene);
        return { before, after, exact };
    },

    /**
     * PlayCanvas' own drawing, with textures that it uploads anew for each image: opaque and blended meshes over all of the image, and the user
     * interface, with splats behind them and without. Bytes of the canvas.
     */
    async beside(url: string, view: string): Promise<[with_: number[], without: number[], splats: number]> {
        const info = await read(url);
        const images = [];
        let shown = 0;
        for (const isShown of [true, false]) {
            const scene = stage(96, 64, [0.2, 0.3, 0.4]);
            const { app, camera, gl } = scene;
            const splats = await load(app, url);
            splats.takeCamera(camera, cameraOf(info, view));
            splats.entity.enabled = isShown;
            const maps = [0, 1, 2].map((seed) => new Texture(app.graphicsDevice, {
                width: 5, height: 4, format: PIXELFORMAT_RGBA8, mipmaps: seed === 1, flipY: true, premultiplyAlpha: true,
            }));
            // Before the splats, and once more after them: what is bound for it is taken to be there still.
            const opaque = material([1, 1, 1], maps[0]);
            const front = plane(scene, opaque, 0.002);
            plane(scene, opaque, 0.0018, [LAYERID_IMMEDIATE]).setLocalScale(1e-3, 1, 1e-3);
            const [blended, overlay] = [material([0.5, 0.5, 0.5], maps[1]), material([1, 1, 1], maps[2])];
            for (const made of [blended, overlay]) {
                Object.assign(made, { opacity: 0.5, blendType: BLEND_NORMAL });
                made.update();
            }
            plane(scene, blended, 0.0015, [LAYERID_UI]);
            plane(scene, overlay, 0.0012, [LAYERID_UI]);
            // First all of the splats are seen, then nothing of them.
            front.enabled = false;
            for (let frame = 0; frame < 3; frame++) {
                for (const [seed, map] of maps.entries()) {
                    const source = Object.assign(document.createElement('canvas'), { width: 5, height: 4 });
                    const context = source.getContext('2d')!;
                    for (let i = 0; i < 20; i++) {
                        context.fillStyle = `rgba(${[i * 37, i * 91 + 50 * frame, seed * 80].map((v) => v % 256).join()}, ${0.5 + (i % 3) / 4})`;
                        context.fillRect(i % 5, Math.floor(i / 5), 1, 1);
                    }
                    map.setSource(source);
                }
                camera.rotateLocal(0, 0.5, 0);
                scene.draw();
                if (frame === 0 && isShown) shown = new Set(canvasPixels(gl, 96, 64)).size;
                front.enabled = true;
            }
            images.push([...canvasPixels(gl, 96, 64)].map((value) => Math.round(255 * value)));
            end(scene);
        }
        return [images[0], images[1], shown];
    },

    /** A disc turned by 45 degrees about y through a mesh that faces the camera: red of the middle row. */
    cut(layerOfItsOwn: boolean): number[] {
        const scene = stage(64, 64);
        const { app, gl, camera } = scene;
        const layer = new Layer({ name: 'splats' });
        app.scene.layers.push(layer);
        camera.camera!.layers = [...camera.camera!.layers, layer.id];
        const splats = disc(app, [1, 1, 1], -0.3, 0.1, Math.PI / 4, infoOf(), layerOfItsOwn ? { layer: layer.id } : {});
        splats.entity.setLocalScale(10, 10, 10);
        splats.entity.setLocalPosition(0.1, 0, 0);
        Object.assign(camera.camera!, { fov: 60, nearClip: 0.1, farClip: 100 });
        plane(scene, material([0, 0, 0]), 3);
        scene.draw();
        const rgba = canvasPixels(gl, 64, 64);
        end(scene);
        return Array.from({ length: 64 }, (_, x) => rgba[4 * (32 * 64 + x)]);
    },

    /** What is warned of, and how bright the middle is, where a camera has no perspective or an entity is stretched. */
    warned(what: 'orthographic' | 'stretched'): { said: string[]; red: number } {
        const scene = stage(32, 32);
        const { entity } = disc(scene.app, [1, 1, 1], -1, 1);
        if (what === 'orthographic') scene.camera.camera!.projection = PROJECTION_ORTHOGRAPHIC;
        else entity.setLocalScale(1, 2, 1);
        const { warn } = console, said: string[] = [];
        console.warn = (message: string) => said.push(message);
        for (let i = 0; i < 2; i++) scene.draw();
        console.warn = warn;
        const red = canvasPixels(scene.gl, 32, 32)[4 * (16 * 32 + 16)];
        end(scene);
        return { said, red };
    },

    /** The middle of a disc of 0.5, whose numbers are of one space, in a target of another: red as it is stored, or what the canvas shows of it. */
    async converted(colourSpace: SceneInfo['colourSpace'], how: How): Promise<number> {
        const scene = stage(32, 32);
        disc(scene.app, [0.5, 0.5, 0.5], -1, 1, 0, { ...infoOf(), colourSpace });
        const { rgb } = await drawn(scene, 32, 32, how);
        end(scene);
        const bytes = Uint8Array.from(atob(rgb), (c) => c.charCodeAt(0));
        return new Float32Array(bytes.buffer)[3 * (16 * 32 + 16)];
    },

    /** What the context holds, by kind: before splats, with them, and after they are disposed of, by `how`. */
    async memory(url: string, view: string, how: 'dispose' | 'entity'): Promise<Record<'before' | 'with' | 'after', Record<string, number>> & { listeners: number[] }> {
        const info = await read(url);
        const scene = stage(64, 64);
        const { app, gl, camera } = scene;
        const live: Record<string, Set<unknown>> = {};
        for (const kind of ['Texture', 'Buffer', 'Framebuffer', 'VertexArray', 'Program', 'Renderbuffer']) {
            const objects = live[kind] = new Set<unknown>();
            const context = gl as unknown as Record<string, (...args: unknown[]) => unknown>;
            const [make, free] = [context[`create${kind}`].bind(gl), context[`delete${kind}`].bind(gl)];
            context[`create${kind}`] = () => { const made = make(); objects.add(made); return made; };
            context[`delete${kind}`] = (object) => { objects.delete(object); return free(object); };
        }
        const count = () => Object.fromEntries(Object.entries(live).map(([kind, objects]) => [kind, objects.size]));
        const listeners = () => (Reflect.get(app.scene, '_callbacks') as Map<string, unknown[]>).get('prerender:layer')?.length ?? 0;
        // Linear light, so that splats are laid over it.
        const during = async () => { await drawn(scene, 64, 64, 'linear'); return count(); };
        const before = await during(), heard = [listeners()];
        const splats = await load(app, url);
        splats.takeCamera(camera, cameraOf(info, view));
        heard.push(listeners());
        const withSplats = await during();
        if (how === 'dispose') splats.dispose();
        else splats.entity.destroy();
        heard.push(listeners());
        const after = await during();
        end(scene);
        return { before, with: withSplats, after, listeners: heard };
    },

    async failure(url: string): Promise<string> {
        const scene = stage(4, 4);
        const said = await loadSplats(scene.app, url).then(() => 'no error', (error: Error) => `${error.name}: ${error.message}`);
        end(scene);
        return said;
    },

    /** A device other than WebGL2. */
    async refused(): Promise<string> {
        const options = new AppOptions();
        options.graphicsDevice = await createGraphicsDevice(document.createElement('canvas'), { deviceTypes: ['null'] });
        options.componentSystems = [CameraComponentSystem];
        const app = new AppBase(document.createElement('canvas'));
        app.init(options);
        try {
            return `no error: ${new LitetexSplats(app, infoOf()).splatCount}`;
        } catch (error) {
            return (error as Error).message;
        }
    },
};

/** One disc in front of the camera, as wide as `sigma`, turned about y. */
function disc(app: AppBase, colour: readonly number[], z: number, sigma: number, turn = 0, info = infoOf(), options = {}): LitetexSplats {
    const splats = new LitetexSplats(app, info, options);
    splats.apply({
        first: 0, bytes: 0, complete: true, splats: discOf(colour, z, sigma, turn),
    });
    app.root.addChild(splats.entity);
    return splats;
}

export type Scenarios = typeof scenarios;

Object.assign(window, { scenarios, ready: true });
