/** Draws scenes with three.js and hands the images to the tests. */

import {
    ArrayCamera, Color, DataTexture, DataUtils, FloatType, Group, HalfFloatType, LinearSRGBColorSpace, Mesh, MeshBasicMaterial, Object3D, PerspectiveCamera, PlaneGeometry, Points, RGBAFormat,
    Scene, SRGBColorSpace, Vector2, Vector4, WebGLRenderer, WebGLRenderTarget, type WebGLRendererParameters,
} from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { EffectComposer } from 'three/addons/postprocessing/EffectComposer.js';
import { OutputPass } from 'three/addons/postprocessing/OutputPass.js';
import { RenderPass } from 'three/addons/postprocessing/RenderPass.js';
import type { SceneCamera, SceneInfo, Splats } from '../../src/core/scene';
import { LitetexGLTFExtension, LitetexLoader, LitetexSplats, type Colours, type SplatsOptions } from '../../src/three';
import { discOf, infoOf, loseAndRestore } from './disc';

export interface Image {
    width: number;
    height: number;
    /** RGB over the scene's background, f32, rows from the top. */
    rgb: string;
}

export type How = 'half' | 'full' | 'canvas' | 'linear' | 'linear-multisampled' | 'linear-splats' | 'linear-canvas' | 'composer-canvas';

const EXACT: SplatsOptions = { storage: 'full' };

async function load(url: string, by: 'loader' | 'gltf', options = EXACT): Promise<LitetexSplats> {
    if (by === 'loader') return new LitetexLoader().setOptions(options).loadAsync(url).then((splats) => splats.loaded.then(() => splats));
    const { scene } = await new GLTFLoader().register((parser) => new LitetexGLTFExtension(parser, options)).loadAsync(url);
    return found(scene);
}

function found(scene: Object3D): LitetexSplats {
    let splats: LitetexSplats | null = null;
    scene.traverse((object) => { if (object instanceof LitetexSplats) splats = object; });
    return splats!;
}

function cameraOf(splats: LitetexSplats, name: string): SceneCamera {
    return splats.info.cameras.find((camera) => camera.name.replace(/\.\w+$/, '') === name)!;
}

function rendererOf(width: number, height: number, parameters: WebGLRendererParameters = {}): WebGLRenderer {
    const renderer = new WebGLRenderer({ alpha: true, ...parameters });
    renderer.setClearColor(0, 0);
    renderer.setSize(width, height, false);
    return renderer;
}

/** Draws, into what `how` says, and reads the image back. */
function drawn(renderer: WebGLRenderer, scene: Scene, camera: PerspectiveCamera, splats: LitetexSplats, how: How): Image {
    const { x: width, y: height } = renderer.getDrawingBufferSize(new Vector2());
    if (how === 'linear-canvas') renderer.outputColorSpace = LinearSRGBColorSpace;
    const onCanvas = how.endsWith('canvas');
    const target = onCanvas ? null : new WebGLRenderTarget(width, height, { type: how === 'full' || how === 'linear' ? FloatType : HalfFloatType, samples: how === 'linear-multisampled' ? 4 : 0 });
    splats.conversion = how === 'linear-splats' ? 'splat' : 'image';
    splats.targetColours = how === 'half' || how === 'full' ? 'display' : 'auto';
    renderer.setRenderTarget(target);
    const composer = how === 'composer-canvas' ? new EffectComposer(renderer) : null;
    composer?.addPass(new RenderPass(scene, camera));
    composer?.addPass(new OutputPass());
    // Twice: what the first image leaves in the renderer's state is wrong in the second, if at all.
    for (let i = 0; i < 2; i++) {
        if (composer) composer.render();
        else renderer.render(scene, camera);
    }
    const rgba = read(renderer, target, width, height);
    composer?.dispose();
    target?.dispose();
    renderer.setRenderTarget(null);
    return { width, height, rgb: composed(rgba, width, height, splats.info.background, how.startsWith('linear')) };
}

function read(renderer: WebGLRenderer, target: WebGLRenderTarget | null, width: number, height: number, x = 0): Float32Array {
    const gl = renderer.getContext();
    if (!target) {
        const bytes = new Uint8Array(4 * width * height);
        gl.readPixels(x, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
        return Float32Array.from(bytes, (byte) => byte / 255);
    }
    if (target.texture.type === FloatType) {
        const floats = new Float32Array(4 * width * height);
        renderer.readRenderTargetPixels(target, 0, 0, width, height, floats);
        return floats;
    }
    const halves = new Uint16Array(4 * width * height);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, halves);
    return Float32Array.from(halves, DataUtils.fromHalfFloat);
}

/** Over the background, turned upside down, as display values. */
function composed(rgba: Float32Array, width: number, height: number, background: readonly number[], linear: boolean): string {
    const rgb = new Float32Array(3 * width * height);
    for (let i = 0; i < rgb.length; i++) {
        const [pixel, c] = [Math.floor(i / 3), i % 3];
        const at = 4 * ((height - 1 - Math.floor(pixel / width)) * width + pixel % width);
        const behind = linear ? new Color().setRGB(background[0], background[1], background[2], 'srgb').toArray()[c] : background[c];
        const value = rgba[at + c] + (1 - rgba[at + 3]) * behind;
        rgb[i] = linear ? encoded(value) : value;
    }
    const bytes = new Uint8Array(rgb.buffer);
    let text = '';
    for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
    return btoa(text);
}

function encoded(c: number): number {
    return c <= 0.0031308 ? 12.92 * Math.max(0, c) : 1.055 * c ** (1 / 2.4) - 0.055;
}

function checked(renderer: WebGLRenderer): void {
    const error = renderer.getContext().getError();
    if (error) throw new Error(`WebGL error ${error}`);
}

export interface Shot {
    url: string;
    by?: 'loader' | 'gltf';
    view: string;
    how: How;
    /** Default: exact. */
    precision?: 'exact' | 'fast';
    options?: SplatsOptions;
    pixelRatio?: number;
    /** Under a parent that is moved, turned and scaled. */
    parent?: boolean;
    /** After the loss of the context. */
    restored?: boolean;
    /** `upside-down`: no damage, but a camera whose image is turned by half a turn, as those of cubes are. */
    control?: 'order' | 'mirrored' | 'upside-down';
    colours?: Colours;
    renderer?: WebGLRendererParameters;
    /** A mesh of this colour over the whole image, behind all splats or in front of them. */
    /** A mesh of the background's colour behind all splats. */
    behind?: boolean;
    mesh?: { colour: [number, number, number]; distance: number };
}

const scenarios = {
    async image(shot: Shot): Promise<Image> {
        const splats = await load(shot.url, shot.by ?? 'loader', shot.options);
        const of = cameraOf(splats, shot.view);
        const ratio = shot.pixelRatio ?? 1;
        const renderer = rendererOf(of.widthPx / ratio, of.heightPx / ratio, shot.renderer);
        renderer.setPixelRatio(ratio);
        const scene = new Scene();
        const root = new Group();
        if (shot.parent) {
            root.position.set(5, -3, 2);
            root.rotation.set(0.5, -1.2, 2.2);
            root.scale.setScalar(3.7);
            splats.scale.multiplyScalar(0.6);
        }
        scene.add(root.add(splats));
        splats.sorting = 'immediate';
        splats.precision = shot.precision ?? 'exact';
        const camera = new PerspectiveCamera(50, 1, 1e-3, 1e4);
        splats.takeCamera(camera, of);
        if (shot.colours) splats.colours = shot.colours;
        if (shot.control === 'mirrored') camera.projectionMatrix.elements[0] *= -1;
        if (shot.control === 'upside-down') for (const i of [0, 5, 8, 9]) camera.projectionMatrix.elements[i] *= -1;
        if (shot.control === 'order') {
            const update = (order: { order: Uint32Array }) => { order.order = Uint32Array.from({ length: splats.splatCount }, (_, i) => i); };
            Reflect.set(Reflect.get(Reflect.get(splats, 'data'), 'orders'), 'update', update);
        }
        const { background } = splats.info;
        const plane = shot.behind ? { colour: new Color().setRGB(...background, /^linear|^composer/.test(shot.how) ? SRGBColorSpace : LinearSRGBColorSpace).toArray(), distance: 9e4 } : shot.mesh;
        if (plane) {
            const mesh = new Mesh(new PlaneGeometry(5 * plane.distance, 5 * plane.distance), new MeshBasicMaterial({ color: new Color(...plane.colour) }));
            mesh.position.z = -plane.distance;
            camera.far = 1e5;
            camera.updateProjectionMatrix();
            scene.add(camera.add(mesh));
        }
        if (shot.restored) {
            const render = () => renderer.render(scene, camera);
            render();
            await loseAndRestore(renderer.getContext() as WebGL2RenderingContext, render);
        }
        const image = drawn(renderer, scene, camera, splats, shot.how);
        checked(renderer);
        splats.dispose();
        renderer.dispose();
        return image;
    },

    /** Two views side by side in one frame, twice. */
    async pair(url: string, views: [string, string], asArray: boolean, precision: 'exact' | 'fast'): Promise<Image[]> {
        const splats = await load(url, 'loader');
        splats.precision = precision;
        const cameras = views.map((name) => cameraOf(splats, name));
        const renderer = rendererOf(cameras[0].widthPx + cameras[1].widthPx, Math.max(...cameras.map((camera) => camera.heightPx)));
        renderer.autoClear = false;
        const scene = new Scene().add(splats);
        const eyes = cameras.map((of) => {
            const camera = new PerspectiveCamera(50, 1, 1e-3, 1e4);
            splats.takeCamera(camera, of);
            return camera;
        });
        for (let frame = 0; frame < 2; frame++) {
            renderer.setScissorTest(false);
            renderer.clear();
            if (asArray) {
                cameras.forEach((of, i) => Object.assign(eyes[i], { viewport: new Vector4(i * cameras[0].widthPx, 0, of.widthPx, of.heightPx) }));
                renderer.render(scene, new ArrayCamera(eyes));
                continue;
            }
            cameras.forEach((of, i) => {
                renderer.setViewport(i * cameras[0].widthPx, 0, of.widthPx, of.heightPx);
                renderer.setScissor(i * cameras[0].widthPx, 0, of.widthPx, of.heightPx);
                renderer.setScissorTest(true);
                renderer.render(scene, eyes[i]);
            });
        }
        const images = cameras.map(({ widthPx: width, heightPx: height }, i) => {
            return { width, height, rgb: composed(read(renderer, null, width, height, i * cameras[0].widthPx), width, height, splats.info.background, false) };
        });
        checked(renderer);
        splats.dispose();
        renderer.dispose();
        return images;
    },

    /** After a small turn an image has the order of before; once `onUpdate` is called, the right one. */
    async turned(url: string, view: string): Promise<{ before: Image; after: Image; exact: Image; updates: number }> {
        const splats = await load(url, 'loader');
        const of = cameraOf(splats, view);
        const renderer = rendererOf(of.widthPx, of.heightPx);
        const scene = new Scene().add(splats);
        const camera = new PerspectiveCamera(50, 1, 1e-3, 1e4);
        splats.takeCamera(camera, of);
        camera.rotateY(0.15);
        camera.updateMatrixWorld();
        renderer.render(scene, camera);
        splats.takeCamera(camera, of);
        let updates = 0;
        const ready = new Promise<void>((resolve) => { splats.onUpdate = () => { updates++; resolve(); }; });
        const before = drawn(renderer, scene, camera, splats, 'full');
        await ready;
        const after = drawn(renderer, scene, camera, splats, 'full');
        splats.sorting = 'immediate';
        const exact = drawn(renderer, scene, camera, splats, 'full');
        splats.dispose();
        renderer.dispose();
        return { before, after, exact, updates };
    },

    /** A disc turned by 45 degrees about y through a mesh that faces the camera: red of the middle row. */
    cut(parameters: WebGLRendererParameters, tilted: boolean, precision: 'exact' | 'fast'): { row: number[]; reversed: boolean; logarithmic: boolean } {
        const splats = disc([1, 1, 1], -0.3, 0.1, Math.PI / 4);
        splats.precision = precision;
        splats.scale.setScalar(10);
        splats.position.set(0.1, 0, 0);
        const mesh = new Mesh(new PlaneGeometry(20, 20), new MeshBasicMaterial({ color: 0 }));
        mesh.position.z = -3;
        const camera = new PerspectiveCamera(60, 1, 0.1, 100);
        // As mirrors tilt the near plane.
        if (tilted) [2, 6, 10, 14].forEach((i, k) => { camera.projectionMatrix.elements[i] = [0.3, -0.2, -0.9, -0.5][k]; });
        const renderer = rendererOf(64, 64, parameters);
        renderer.render(new Scene().add(mesh, splats), camera);
        const rgba = read(renderer, null, 64, 64);
        checked(renderer);
        const result = {
            row: Array.from({ length: 64 }, (_, x) => rgba[4 * (32 * 64 + x)]),
            reversed: renderer.state.buffers.depth.getReversed(), logarithmic: renderer.capabilities.logarithmicDepthBuffer,
        };
        splats.dispose();
        renderer.dispose();
        return result;
    },

    /** The middle of a disc of 0.5, whose numbers are of one space, in a target of another. */
    converted(colourSpace: SceneInfo['colourSpace'], how: 'target' | 'canvas'): number {
        return middleOf(new Scene().add(disc([0.5, 0.5, 0.5], -1, 1, 0, { ...infoOf(), colourSpace })), how)[0];
    },

    /** Red in front of green, as two objects. */
    stacked(greenLast: boolean): number[] {
        const [red, green] = [disc([1, 0, 0], -1, 1), disc([0, 1, 0], -2, 1)];
        green.renderOrder = greenLast ? 1 : 0;
        return middleOf(new Scene().add(red, green), 'canvas');
    },

    /** Splats that arrive in parts, between frames in which three.js uploads a texture of its own. */
    async parts(url: string, view: string, precision: 'exact' | 'fast'): Promise<Image> {
        const whole = await load(url, 'loader');
        const of = cameraOf(whole, view);
        const { splats: all } = (Reflect.get(whole, 'data') as { parts: { splats: Splats }[] }).parts[0];
        const splats = new LitetexSplats(whole.info, EXACT);
        splats.sorting = 'immediate';
        splats.precision = precision;
        const renderer = rendererOf(of.widthPx, of.heightPx);
        const camera = new PerspectiveCamera(50, 1, 1e-3, 1e5);
        splats.takeCamera(camera, of);
        const map = new DataTexture(Float32Array.from({ length: 16 }, (_, i) => [...whole.info.background, 1][i % 4]), 2, 2, RGBAFormat, FloatType);
        Object.assign(map, { flipY: true, premultiplyAlpha: true });
        const mesh = new Mesh(new PlaneGeometry(4e5, 4e5), new MeshBasicMaterial({ map }));
        mesh.position.z = -9e4;
        const scene = new Scene().add(splats, camera.add(mesh));
        let image: Image;
        for (const [first, end] of [[0, 12], [12, 30], [7, 20], [20, all.count]]) {
            splats.apply({ first, splats: partOf(all, first, end), bytes: 0, complete: true });
            map.needsUpdate = true;
            image = drawn(renderer, scene, camera, splats, 'full');
        }
        checked(renderer);
        splats.dispose();
        renderer.dispose();
        return image!;
    },

    /** Textures of the renderer with splats, and after they are disposed of. */
    async memory(url: string, view: string): Promise<{ before: number; with: number; after: number; geometries: number; programs: number; alive: boolean }> {
        const splats = await load(url, 'loader');
        const renderer = rendererOf(64, 64);
        const scene = new Scene().add(splats, splats.clone());
        const camera = new PerspectiveCamera();
        splats.takeCamera(camera, cameraOf(splats, view));
        const { memory } = renderer.info;
        const before = memory.textures;
        renderer.render(scene, camera);
        const drawnWith = memory.textures;
        const { gpu } = [...(Reflect.get(Reflect.get(splats, 'data'), 'gpus') as Map<object, { gpu: { buffers: { splats: { texture: WebGLTexture } } } }>).values()][0];
        const { texture } = gpu.buffers.splats;
        const isAlive = () => (renderer.getContext() as WebGL2RenderingContext).isTexture(texture);
        if (!isAlive()) throw new Error('the texture is not there');
        for (const object of [...scene.children]) (object as LitetexSplats).dispose();
        scene.clear();
        renderer.render(scene, camera);
        const result = { before, with: drawnWith, after: memory.textures, geometries: memory.geometries, programs: renderer.info.programs!.length, alive: isAlive() };
        renderer.dispose();
        return result;
    },

    /** A file whose mesh has splats and points, as .gltf with all its bytes in other files. */
    async mixed(url: string): Promise<{ types: string[]; splats: number; name: string; scale: number }> {
        const file = await (await fetch(url)).arrayBuffer();
        const jsonBytes = new DataView(file).getUint32(12, true);
        const json = JSON.parse(new TextDecoder().decode(new Uint8Array(file, 20, jsonBytes)));
        const bin = file.slice(28 + jsonBytes);
        json.buffers[0].uri = URL.createObjectURL(new Blob([bin]));
        for (const image of json.images ?? []) {
            const { byteOffset = 0, byteLength } = json.bufferViews[image.bufferView];
            image.uri = URL.createObjectURL(new Blob([bin.slice(byteOffset, byteOffset + byteLength)]));
            delete image.bufferView;
        }
        const { POSITION } = json.meshes[0].primitives[0].attributes;
        json.meshes[0].primitives.push({ mode: 0, attributes: { POSITION } });
        const loader = new GLTFLoader().register((parser) => new LitetexGLTFExtension(parser));
        const { scene } = await loader.parseAsync(JSON.stringify(json), '');
        const types: string[] = [];
        scene.traverse((object) => types.push(object instanceof Points ? 'Points' : object.type));
        const splats = found(scene);
        return { types, splats: splats.splatCount, name: splats.parent!.name, scale: splats.getWorldScale(splats.position).x };
    },

    async failure(url: string): Promise<string> {
        return load(url, 'loader').then(() => 'no error', (error: Error) => `${error.name}: ${error.message}`);
    },

    async webgpu(): Promise<string> {
        const { WebGPURenderer } = await import('three/webgpu');
        const renderer = new WebGPURenderer({ forceWebGL: true });
        await renderer.init();
        try {
            renderer.render(new Scene().add(new LitetexSplats(infoOf())), new PerspectiveCamera());
            return 'no error';
        } catch (error) {
            return (error as Error).message;
        }
    },
};

function partOf(splats: Splats, first: number, end: number): Splats {
    const before = (stop: number, width: (splat: number) => number) => Array.from({ length: stop }, (_, i) => width(i)).reduce((a, b) => a + b, 0);
    const part = <T extends { subarray(from: number, to: number): T }>(array: T, width: (splat: number) => number) => array.subarray(before(first, width), before(end, width));
    return {
        count: end - first, positions: part(splats.positions, () => 3), rotations: part(splats.rotations, () => 4), scales: part(splats.scales, () => 2),
        opacities: part(splats.opacities, () => 1), shDegrees: part(splats.shDegrees, () => 1), sh: part(splats.sh, (i) => 3 * (splats.shDegrees[i] + 1) ** 2),
        rows: part(splats.rows, () => 1), cols: part(splats.cols, () => 1), texelSizes: part(splats.texelSizes, () => 2), shifts: part(splats.shifts, () => 2),
        texels: part(splats.texels, (i) => 3 * splats.rows[i] * splats.cols[i]),
    };
}

/** One disc in front of the camera, as wide as `sigma`, turned about y. */
function disc(colour: readonly number[], z: number, sigma: number, turn = 0, info = infoOf()): LitetexSplats {
    const splats = new LitetexSplats(info, EXACT);
    splats.apply({
        first: 0, bytes: 0, complete: true, splats: discOf(colour, z, sigma, turn),
    });
    return splats;
}

/** The middle of the image of some discs, RGBA. */
function middleOf(scene: Scene, how: 'target' | 'canvas'): number[] {
    const renderer = rendererOf(32, 32);
    const target = how === 'canvas' ? null : new WebGLRenderTarget(32, 32, { type: FloatType });
    renderer.setRenderTarget(target);
    renderer.render(scene, new PerspectiveCamera(50, 1, 0.01, 100));
    const rgba = read(renderer, target, 32, 32);
    checked(renderer);
    scene.children.forEach((object) => (object as LitetexSplats).dispose());
    target?.dispose();
    renderer.dispose();
    return [...rgba.subarray(4 * (16 * 32 + 16), 4 * (16 * 32 + 17))];
}

export type Scenarios = typeof scenarios;

Object.assign(window, { scenarios, ready: true });
