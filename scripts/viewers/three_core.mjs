// three.js without add-ons for splats, on WebGL. Options: `loader` (gltf or usd); `material`, properties to set on all materials.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { USDLoader } from 'three/addons/loaders/USDLoader.js';
import { pixels, projection } from '/png.mjs';

export async function render(job) {
    const { width, height, worldFromCamera } = job.camera;
    const renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
    renderer.setSize(width, height, false);
    renderer.setClearColor(0x000000, 1);
    const scene = new THREE.Scene();
    const loaded = job.options.loader === 'usd' ? await new USDLoader().loadAsync(job.url) : (await new GLTFLoader().loadAsync(job.url)).scene;
    loaded.traverse((object) => Object.assign(object.material ?? {}, job.options.material));
    scene.add(loaded);
    const camera = new THREE.PerspectiveCamera();
    camera.matrixAutoUpdate = false;
    camera.matrix.fromArray(worldFromCamera);
    camera.projectionMatrix.fromArray(projection(job.camera));
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    camera.updateMatrixWorld(true);
    // Textures of loaders may still be decoding.
    await new Promise((resolve) => setTimeout(resolve, 1500));
    renderer.render(scene, camera);
    return pixels(renderer.domElement);
}
