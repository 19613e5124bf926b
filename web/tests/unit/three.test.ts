import { Box3, Matrix4, Mesh, MeshBasicMaterial, Object3D, OrthographicCamera, PerspectiveCamera, PlaneGeometry, Quaternion, Raycaster, Scene, Vector3, type WebGLRenderer } from 'three';
import { describe, expect, test, vi } from 'vitest';
import type { SceneCamera, SceneInfo, Splats } from '../../src/core/scene';
import { LitetexSplats, type SplatIntersection } from '../../src/three/splats';
import { CameraOrder, Orders } from '../../src/guest/orders';
import { similarityOf, viewOfCamera } from '../../src/guest/view';
import { takeSceneCamera } from '../../src/three/view';

const VIEWPORT = { x: 0, y: 0, width: 640, height: 480 };

function infoOf(splats: number): SceneInfo {
    return {
        container: 'ltgs', quality: 'lossless', splats, texels: 0, shDegree: 0, near: 0.01, filter: 'none', background: [0, 0, 0], colourSpace: 'srgb_rec709_display',
        worldFromData: new Matrix4().elements, captureFromData: null, cameras: [], home: null, bounds: null, untextured: null, standInUntil: null, fileBytes: 0,
        provenance: { title: '', author: '', licence: '', source: '', up: '', programVersion: '', scale: '', training: {} },
    };
}

/** Discs that face z, with centre, standard deviation and opacity. */
function discs(...list: [x: number, y: number, z: number, sigma: number, opacity: number][]): Splats {
    const n = list.length;
    return {
        count: n,
        positions: new Float32Array(list.flatMap((d) => d.slice(0, 3))),
        rotations: new Float32Array(list.flatMap(() => [0, 0, 0, 1])),
        scales: new Float32Array(list.flatMap((d) => [d[3], d[3]])),
        opacities: new Float32Array(list.map((d) => d[4])),
        shDegrees: new Uint8Array(n), sh: new Float32Array(3 * n), rows: new Uint16Array(n), cols: new Uint16Array(n),
        texelSizes: new Float32Array(2 * n), shifts: new Int16Array(2 * n), texels: new Float32Array(0),
    };
}

function objectOf(splats: Splats, maxSplats = Infinity): LitetexSplats {
    const object = new LitetexSplats(infoOf(splats.count), { maxSplats });
    object.apply({ first: 0, splats, bytes: 0, complete: true });
    return object;
}

/** Where three.js shows a point of the data, px from the upper left corner, and its depth in clip space. */
function projected(point: Vector3, matrixWorld: Matrix4, camera: PerspectiveCamera): [number, number, number] {
    const ndc = point.clone().applyMatrix4(matrixWorld).project(camera);
    return [0.5 * VIEWPORT.width * (1 + ndc.x), 0.5 * VIEWPORT.height * (1 - ndc.y), ndc.z];
}

/** The same by our view. */
function seen(point: Vector3, matrixWorld: Matrix4, camera: PerspectiveCamera): [number, number, number] {
    const view = viewOfCamera(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements, matrixWorld.elements, VIEWPORT)!;
    expect(view.exact).toBe(true);
    const { rotation: r, translation: t, focalPx, principalPx, depthFromInverse, depthSlope } = view;
    const [x, y, z] = [0, 3, 6].map((i) => r[i] * point.x + r[i + 1] * point.y + r[i + 2] * point.z + t[i / 3]);
    const offset = [focalPx[0] * x / z, focalPx[1] * y / z];
    const depth = depthFromInverse[0] + depthFromInverse[1] / z + depthSlope[0] * offset[0] + depthSlope[1] * offset[1];
    return [offset[0] + principalPx[0], offset[1] + principalPx[1], depth];
}

describe('views', () => {
    const parent = new Object3D();
    parent.position.set(3, -2, 5);
    parent.quaternion.setFromAxisAngle(new Vector3(1, 2, 2).normalize(), 0.7);
    parent.scale.setScalar(2.5);
    const child = new Object3D();
    child.position.set(-1, 0.5, 0.25);
    child.quaternion.setFromAxisAngle(new Vector3(2, -1, 2).normalize(), -1.1);
    child.scale.setScalar(0.4);
    parent.add(child);
    parent.updateMatrixWorld(true);

    const cameras: [string, (camera: PerspectiveCamera) => void][] = [
        ['centred', () => {}],
        ['with a view offset and zoom', (c) => { c.zoom = 1.3; c.setViewOffset(1280, 960, 300, 100, 640, 480); }],
        ['with a film offset', (c) => { c.filmOffset = 5; c.updateProjectionMatrix(); }],
        ['of a cube, which is upside down', (c) => { c.fov = -90; c.aspect = 1; c.updateProjectionMatrix(); }],
        ['with reversed depth', (c) => { (c as unknown as { _reversedDepth: boolean })._reversedDepth = true; c.updateProjectionMatrix(); }],
        ['with a tilted near plane', (c) => { const e = c.projectionMatrix.elements; [e[2], e[6], e[10], e[14]] = [0.3, -0.2, 0.9, -0.5]; }],
    ];
    test.each(cameras)('a camera %s sees points where three.js does', (_, change) => {
        const camera = new PerspectiveCamera(50, 640 / 480, 0.1, 100);
        camera.position.set(6, 1, 12);
        camera.lookAt(2, -2, 5);
        camera.updateMatrixWorld();
        change(camera);
        for (const point of [new Vector3(0, 0, 0), new Vector3(0.7, -0.3, 0.5), new Vector3(-1, 1, -2)]) {
            const [expected, actual] = [projected(point, child.matrixWorld, camera), seen(point, child.matrixWorld, camera)];
            expected.forEach((value, i) => expect(actual[i]).toBeCloseTo(value, 6));
        }
    });

    test('a camera of the capture is taken exactly', () => {
        const rotation = new Matrix4().makeRotationFromQuaternion(new Quaternion(0.1, -0.5, 0.3, 0.8).normalize()).elements;
        const of: SceneCamera = {
            name: '', widthPx: 640, heightPx: 480, focalPx: [500, 520], principalPx: [300, 250], heldOut: false, translation: [0.1, -0.2, 3],
            rotation: [rotation[0], rotation[4], rotation[8], rotation[1], rotation[5], rotation[9], rotation[2], rotation[6], rotation[10]],
        };
        const camera = new PerspectiveCamera();
        takeSceneCamera(camera, of, child.matrixWorld);
        const view = viewOfCamera(camera.projectionMatrix.elements, camera.matrixWorldInverse.elements, child.matrixWorld.elements, VIEWPORT)!;
        of.rotation.forEach((value, i) => expect(view.rotation[i]).toBeCloseTo(value, 9));
        of.translation.forEach((value, i) => expect(view.translation[i]).toBeCloseTo(value, 9));
        expect(view.focalPx.map((f) => Math.round(1e6 * f))).toEqual([500e6, 520e6]);
        expect(view.principalPx.map((c) => Math.round(1e6 * c))).toEqual([300e6, 250e6]);
    });

    test('of uneven scales the closest similarity is taken', () => {
        const turn = new Matrix4().makeRotationAxis(new Vector3(0, 0, 1), 0.5);
        const { scale, rotation, exact } = similarityOf(turn.clone().scale(new Vector3(1, 2, 3)).elements);
        expect([exact, scale]).toEqual([false, expect.closeTo(2, 9)]);
        const e = turn.elements;
        [e[0], e[4], e[8], e[1], e[5], e[9]].forEach((value, i) => expect(rotation[i]).toBeCloseTo(value, 9));
        expect(similarityOf(new Matrix4().makeScale(-1, 1, 1).elements).exact).toBe(false);
        expect(similarityOf(turn.clone().scale(new Vector3(1e-4, 1e-4, 1e-4)).elements).exact).toBe(true);
    });
});

describe('picking', () => {
    const ray = (object: Object3D, origin: Vector3, direction: Vector3) => {
        object.updateWorldMatrix(true, true);
        return new Raycaster(origin, direction.clone().normalize()).intersectObject(object) as unknown as SplatIntersection[];
    };

    test('the surface is where half of the light is gone', () => {
        const object = objectOf(discs([0, 0, -3, 1, 0.99], [0, 0, -2, 1, 0.4], [0, 0, -1, 1, 0.3], [5, 0, -0.5, 0.1, 1]));
        const hits = ray(object, new Vector3(0, 0, 1), new Vector3(0, 0, -1));
        expect(hits.map(({ splatIndex, distance }) => [splatIndex, distance])).toEqual([[1, 3]]); // 0.7 * 0.6 < 0.5
        expect(hits[0].normal.toArray()).toEqual([0, 0, 1]);
        expect(hits[0].alpha).toBeCloseTo(0.4);
        expect(ray(object, new Vector3(20, 0, 1), new Vector3(0, 0, -1))).toEqual([]);
        expect(ray(objectOf(discs([0, 0, 0, 1, 0.3])), new Vector3(0, 0, 1), new Vector3(0, 0, -1))).toEqual([]);
    });

    test('parents move, turn and scale what is picked', () => {
        const object = objectOf(discs([1, 2, 3, 0.5, 0.9]));
        const parent = new Object3D();
        parent.position.set(10, 0, 0);
        parent.rotation.set(0.3, 0.8, -0.4);
        parent.scale.setScalar(3);
        parent.add(object);
        parent.updateMatrixWorld(true);
        const centre = new Vector3(1, 2, 3).applyMatrix4(parent.matrixWorld);
        const normal = new Vector3(0, 0, 1).transformDirection(parent.matrixWorld);
        const origin = centre.clone().addScaledVector(normal, 7);
        const [hit] = ray(parent, origin, normal.clone().negate());
        expect(hit.distance).toBeCloseTo(7, 4);
        expect(hit.point.distanceTo(centre)).toBeLessThan(1e-4);
        expect(hit.normal.distanceTo(normal)).toBeLessThan(1e-6);
        expect(hit.object).toBe(object);
        // Off by one standard deviation and a half: 0.9 exp(-9/8) < 0.5.
        const aside = new Vector3(1.75, 2, 3).applyMatrix4(parent.matrixWorld).addScaledVector(normal, 7);
        expect(ray(parent, aside, normal.clone().negate())).toEqual([]);
    });

    test('hits of several objects are in the order of their distance', () => {
        const scene = new Scene();
        const far = objectOf(discs([0, 0, 0, 1, 0.9])), near = far.clone();
        near.position.z = 1;
        const mesh = new Mesh(new PlaneGeometry(), new MeshBasicMaterial());
        mesh.position.z = 0.5;
        scene.add(far, near, mesh);
        scene.updateMatrixWorld(true);
        const hits = new Raycaster(new Vector3(0.1, 0.2, 5), new Vector3(0, 0, -1)).intersectObjects(scene.children);
        expect(hits.map(({ object }) => object.uuid)).toEqual([near.uuid, mesh.uuid, far.uuid]);
    });
});

describe('objects', () => {
    const grid = Array.from({ length: 200 }, (_, i) => [i / 100 - 1, (i * 7 % 200) / 100 - 1, (i * 13 % 200) / 100 - 1, 0.1, 0.5] as [number, number, number, number, number]);

    test('bounds leave floaters out', () => {
        const object = objectOf(discs(...grid, [1000, 0, 0, 1, 1], [0, -500, 0, 1, 1], [0, 0, 1e6, 1, 1]));
        object.computeBoundingBox();
        object.computeBoundingSphere();
        expect(object.boundingBox!.min.x).toBeGreaterThan(-1);
        expect(object.boundingBox!.max.z).toBeLessThan(1);
        expect(object.boundingBox!.max.x).toBeGreaterThan(0.8);
        expect(object.boundingSphere!.radius).toBeLessThan(1.8);
        object.scale.setScalar(2);
        expect(new Box3().setFromObject(object).max.x).toBeGreaterThan(1.6);
    });

    test('later parts replace earlier ones, and maxSplats bounds them', () => {
        const object = objectOf(discs(...grid), 150);
        expect(object.splatCount).toBe(150);
        const onUpdate = vi.fn();
        object.onUpdate = onUpdate;
        object.computeBoundingBox();
        object.apply({ first: 100, splats: discs([0, 0, 9, 1, 0.9]), bytes: 0, complete: true });
        expect([object.splatCount, object.boundingBox, onUpdate.mock.calls.length]).toEqual([101, null, 1]);
        const [hit] = new Raycaster(new Vector3(0, 0, 20), new Vector3(0, 0, -1)).intersectObject(object) as unknown as SplatIntersection[];
        expect(hit.splatIndex).toBe(100);
    });

    test('clones share splats until the last is disposed of', () => {
        const first = objectOf(discs([0, 0, 0, 1, 0.9])), second = first.clone();
        expect(second.material).not.toBe(first.material);
        first.geometry.dispose();
        expect(second.splatCount).toBe(1);
        second.dispose();
        expect(second.splatCount).toBe(0);
    });

    test('what cannot be drawn is said', () => {
        const object = objectOf(discs([0, 0, 0, 1, 0.9]));
        const draw = (renderer: object, camera: OrthographicCamera) => object.onBeforeRender(renderer as WebGLRenderer, new Scene(), camera, object.geometry, object.material);
        expect(() => draw({}, new OrthographicCamera())).toThrow('WebGLRenderer only');
        const warn = vi.spyOn(console, 'warn').mockImplementation(() => {});
        const renderer = { isWebGLRenderer: true, state: { buffers: { depth: { getReversed: () => false } } }, getCurrentViewport: (v: { set(...n: number[]): void }) => v.set(0, 0, 8, 8) };
        draw(renderer, new OrthographicCamera());
        draw(renderer, new OrthographicCamera());
        expect(warn.mock.calls).toEqual([[expect.stringContaining('without perspective')]]);
        warn.mockRestore();
    });
});

test('each camera has its own order', () => {
    const orders = new Orders(() => {});
    orders.setPositions(0, new Float32Array([0, 0, 1, 0, 0, 2, 0, 0, 3]));
    const [front, back] = [new CameraOrder(), new CameraOrder()];
    orders.update(front, { axis: [0, 0, 1], offset: 0 }, false);
    orders.update(back, { axis: [0, 0, -1], offset: 5 }, false);
    expect([[...front.order], [...back.order]]).toEqual([[2, 1, 0], [0, 1, 2]]);
    orders.update(front, { axis: [0, 0, 1], offset: -7 }, false);
    expect([front.version, back.version]).toEqual([1, 1]);
    orders.setPositions(2, new Float32Array([0, 0, 0.5]));
    orders.update(front, { axis: [0, 0, 1], offset: 0 }, false);
    expect([...front.order]).toEqual([1, 0, 2]);
    orders.dispose();
});
