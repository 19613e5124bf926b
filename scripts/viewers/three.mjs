// three.js with its add-on for Gaussian splats, on WebGPU. Options: `loader` (gltf, ply or spz), `output` ("default": sRGB, or "linear").
import * as THREE from 'three';
import { GLTFGaussianSplatLoaderExtension } from 'three/addons/loaders/GLTFGaussianSplatLoaderExtension.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { GaussianSplatPLYLoader } from 'three/addons/loaders/GaussianSplatPLYLoader.js';
import { SPZLoader } from 'three/addons/loaders/SPZLoader.js';
import { GaussianSplat } from 'three/addons/objects/GaussianSplat.js';
import { projection, turned } from '/png.mjs';

async function load({ url, options }) {
    if (options.loader === 'gltf') {
        const loader = new GLTFLoader();
        loader.register((parser) => new GLTFGaussianSplatLoaderExtension(parser));
        return (await loader.loadAsync(url)).scene;
    }
    const loader = options.loader === 'ply' ? new GaussianSplatPLYLoader() : new SPZLoader();
    return new GaussianSplat(await loader.loadAsync(url));
}

/** What the output pass makes of a value in [0, 1] for an sRGB canvas. */
const encoded = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);

export async function render(job) {
    const { width, height, worldFromCamera } = job.camera;
    const renderer = new THREE.WebGPURenderer({ antialias: false });
    await renderer.init();
    if (!renderer.backend.isWebGPUBackend) throw new Error('no WebGPU');
    renderer.setClearColor(0x000000, 1);
    const scene = new THREE.Scene();
    scene.add(await load(job));
    const camera = new THREE.PerspectiveCamera();
    camera.coordinateSystem = renderer.coordinateSystem;
    camera.matrixAutoUpdate = false;
    camera.matrix.fromArray(worldFromCamera);
    camera.near = job.camera.near;
    camera.projectionMatrix.fromArray(projection(job.camera, 0));
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    camera.updateMatrixWorld(true);
    // A render target holds what the canvas gets before its output pass.
    const target = new THREE.RenderTarget(width, height, { type: THREE.HalfFloatType });
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const halves = await renderer.readRenderTargetPixelsAsync(target, 0, 0, width, height);
    // All rows but the last may be padded to multiples of 256 bytes.
    const padded = Math.ceil(width / 32) * 128;
    const stride = halves.length >= padded * (height - 1) + 4 * width ? padded : 4 * width;
    const data = new Uint8ClampedArray(4 * width * height);
    for (let y = 0; y < height; y++) {
        for (let i = 0; i < 4 * width; i++) {
            const value = Math.min(1, Math.max(0, THREE.DataUtils.fromHalfFloat(halves[y * stride + i])));
            data[4 * width * y + i] = 255 * (job.options.output === 'linear' ? value : encoded(value));
        }
    }
    const draw = async (i) => {
        camera.matrix.fromArray(turned(worldFromCamera, 0.01 * (i % 2)));
        camera.updateMatrixWorld(true);
        renderer.render(scene, camera);
        await renderer.readRenderTargetPixelsAsync(target, 0, 0, 1, 1);
    };
    return { width, height, data, draw };
}
