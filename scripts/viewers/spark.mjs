// Spark, on three.js with WebGL.
import { SparkRenderer, SplatMesh } from '@sparkjsdev/spark';
import * as THREE from 'three';
import { frames, pixels, projection, turned } from '/png.mjs';

export async function render(job) {
    const { width, height, worldFromCamera } = job.camera;
    const renderer = new THREE.WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
    renderer.setSize(width, height, false);
    renderer.setClearColor(0x000000, 1);
    const scene = new THREE.Scene();
    scene.add(new SparkRenderer({ renderer }));
    const splats = new SplatMesh({ url: job.url });
    await splats.initialized;
    scene.add(splats);
    const camera = new THREE.PerspectiveCamera();
    camera.matrixAutoUpdate = false;
    camera.matrix.fromArray(worldFromCamera);
    camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
    camera.near = job.camera.near;
    camera.far = 1e4 * job.camera.near;
    camera.projectionMatrix.fromArray(projection(job.camera));
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    camera.updateMatrixWorld(true);
    await frames(25, () => renderer.render(scene, camera));
    const image = pixels(renderer.domElement);
    const gl = renderer.getContext();
    const draw = (i) => {
        camera.matrix.fromArray(turned(worldFromCamera, 0.01 * (i % 2)));
        camera.updateMatrixWorld(true);
        renderer.render(scene, camera);
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    };
    return { ...image, draw };
}
