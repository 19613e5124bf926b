// The engine of PlayCanvas, on WebGL. Options: `loader` (gltf, ply, or litetex: our own package, built into the folder LITETEX_WEB), `turn`:
// half a turn of the loaded splats about x.
import * as pc from 'playcanvas';
import { frames, pixels, projection, turned } from '/png.mjs';

async function load(app, { url, options: { loader } }) {
    if (loader === 'litetex') {
        const { loadSplats } = await import('/litetex/playcanvas.js');
        const splats = await loadSplats(app, url);
        await splats.loaded;
        return splats.entity;
    }
    const kind = loader === 'gltf' ? 'container' : 'gsplat';
    const asset = new pc.Asset('scene', kind, { url });
    await new Promise((resolve, reject) => {
        asset.on('load', resolve);
        asset.on('error', (error) => reject(new Error(String(error))));
        app.assets.add(asset);
        app.assets.load(asset);
    });
    if (kind === 'container') return asset.resource.instantiateRenderEntity();
    const entity = new pc.Entity('splats');
    entity.addComponent('gsplat', { asset });
    return entity;
}

export async function render(job) {
    const { width, height, worldFromCamera } = job.camera;
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [width, height];
    document.body.append(canvas);
    const app = new pc.Application(canvas, { graphicsDeviceOptions: { preserveDrawingBuffer: true, antialias: false } });
    app.setCanvasFillMode(pc.FILLMODE_NONE, width, height);
    app.setCanvasResolution(pc.RESOLUTION_FIXED, width, height);
    app.start();
    const entity = await load(app, job);
    if (job.options.turn) entity.setLocalEulerAngles(180, 0, 0);
    app.root.addChild(entity);
    const camera = new pc.Entity('camera');
    camera.addComponent('camera', { clearColor: new pc.Color(0, 0, 0, 1), nearClip: job.camera.near, farClip: 1e4 * job.camera.near });
    camera.camera.calculateProjection = (matrix) => matrix.set(projection(job.camera));
    const world = new pc.Mat4().set(worldFromCamera);
    camera.setPosition(world.getTranslation());
    camera.setRotation(new pc.Quat().setFromMat4(world));
    app.root.addChild(camera);
    await frames(60);
    const image = pixels(canvas);
    app.autoRender = false;
    Object.defineProperty(app, 'renderNextFrame', { get: () => false, set() {} }); // orders that arrive draw no image of their own
    const { gl } = app.graphicsDevice;
    const draw = (i) => {
        camera.setRotation(new pc.Quat().setFromMat4(new pc.Mat4().set(turned(worldFromCamera, 0.01 * (i % 2)))));
        app.render();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    };
    return { ...image, draw };
}
