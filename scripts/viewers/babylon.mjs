// Babylon.js, on WebGL, in a left-handed scene, its default, unless the option `rightHanded` is set. Option `flipY`: that of its SPZ
// loader. Option `turn`: half a turn of the loaded splats about x.
import { FreeCamera } from '@babylonjs/core/Cameras/freeCamera.js';
import { Engine } from '@babylonjs/core/Engines/engine.js';
import { Color4 } from '@babylonjs/core/Maths/math.color.js';
import { Matrix, Quaternion, Vector3 } from '@babylonjs/core/Maths/math.vector.js';
import { Scene } from '@babylonjs/core/scene.js';
import '@babylonjs/core/Meshes/GaussianSplatting/gaussianSplattingMesh.js';
import '@babylonjs/core/Materials/GaussianSplatting/gaussianSplattingMaterial.js';
import { ImportMeshAsync } from '@babylonjs/core/Loading/sceneLoader.js';
import '@babylonjs/loaders/SPLAT/index.js';
import '@babylonjs/loaders/glTF/2.0/index.js';
import { frames, pixels, projection } from '/png.mjs';

export async function render(job) {
    const { width, height } = job.camera;
    const { options } = job;
    // Left-handed: z points the other way in the world and in the camera, from which it looks along +z.
    const [mirrored, flat] = options.rightHanded ? [(v) => v, (v) => v] : [
        (m) => m.map((v, i) => ((i % 4 === 2) !== (i >> 2 === 2) ? -v : v)),
        (m) => m.map((v, i) => (i >> 2 === 2 ? -v : v)),
    ];
    const worldFromCamera = mirrored(job.camera.worldFromCamera);
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [width, height];
    document.body.append(canvas);
    const engine = new Engine(canvas, false, { preserveDrawingBuffer: true });
    const scene = new Scene(engine);
    scene.useRightHandedSystem = options.rightHanded ?? false;
    scene.clearColor = new Color4(0, 0, 0, 1);
    const { meshes } = await ImportMeshAsync(job.url, scene, { pluginOptions: { splat: { flipY: options.flipY ?? false, spzLibraryUrl: undefined } } });
    if (options.turn) meshes.forEach((mesh) => mesh.rotate(Vector3.Right(), Math.PI));
    const camera = new FreeCamera('camera', Vector3.Zero(), scene);
    const [scale, rotation, position] = [new Vector3(), new Quaternion(), new Vector3()];
    Matrix.FromArray(worldFromCamera).decompose(scale, rotation, position);
    camera.position = position;
    camera.rotationQuaternion = rotation;
    camera.minZ = job.camera.near;
    camera.maxZ = 1e4 * job.camera.near;
    camera.freezeProjectionMatrix(Matrix.FromArray(flat(projection(job.camera))));
    await scene.whenReadyAsync();
    await frames(30, () => scene.render());
    return pixels(canvas);
}
