import { expect, test } from 'vitest';
import type { SceneCamera, SceneInfo } from '../../src/core/scene';
import { centreOf, viewOf } from '../../src/core/render/view';
import { radiusPx } from '../../src/viewer/bounds';
import { Glide } from '../../src/viewer/glide';
import { fitted, homePose, keepNear, Pose } from '../../src/viewer/pose';
import { cross, dot, length, type Vec3 } from '../../src/viewer/vector';

const CAMERA: SceneCamera = {
    name: 'a', widthPx: 400, heightPx: 300, focalPx: [350, 340], principalPx: [190, 160],
    rotation: [0.8, 0, 0.6, 0, 1, 0, -0.6, 0, 0.8], translation: [0.5, -1, 3], heldOut: false,
};

test('a camera is taken exactly', () => {
    const pose = new Pose();
    pose.goTo(CAMERA);
    const view = pose.view(800, 600);
    const expected = viewOf(CAMERA, 800, 600);
    view.rotation.forEach((r, i) => expect(r).toBeCloseTo(expected.rotation[i], 12));
    view.translation.forEach((t, i) => expect(t).toBeCloseTo(expected.translation[i], 12));
    expect(view.focalPx).toEqual(expected.focalPx);
    expect(view.principalPx).toEqual(expected.principalPx);
});

test('up is that of the world, not the mean of the cameras, which look down', () => {
    // Data with z up.
    const worldFromData = [1, 0, 0, 0, 0, 0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1];
    const info = { worldFromData, cameras: [CAMERA], home: 0 } as unknown as SceneInfo;
    const bounds = { centre: [0, 0, 0] as Vec3, radius: 1 };
    homePose(info, bounds).up.forEach((v, i) => expect(v).toBeCloseTo([0, 0, 1][i], 12));
    const without = homePose({ ...info, cameras: [] }, bounds);
    expect(dot(without.centre, without.up)).toBeGreaterThan(0.3);
    expect(dot(without.down, without.up)).toBeLessThan(-0.9);
    expect(dot(without.right, without.up)).toBeCloseTo(0, 12);
});

test('an image is fitted into a viewport of another shape, whole and centred', () => {
    expect(fitted(CAMERA, 400, 600)).toEqual({ scale: 1, x: 0, y: 150 });
    const pose = new Pose();
    pose.goTo(CAMERA);
    expect(pose.view(400, 600).principalPx).toEqual([190, 310]);
});

test('orbits keep the target, turns on the spot keep the place, and axes stay orthonormal', () => {
    const pose = new Pose();
    pose.goTo(CAMERA);
    pose.distance = 2;
    const target = pose.target;
    for (let i = 0; i < 50; i++) pose.turn(0.3, i % 2 ? 0.2 : -0.15);
    pose.target.forEach((t, i) => expect(t).toBeCloseTo(target[i], 9));
    const centre = pose.centre;
    pose.turn(0.3, 0.1, true);
    expect(pose.centre).toEqual(centre);
    expect(length(pose.down)).toBeCloseTo(1, 9);
    expect(dot(pose.right, pose.forward)).toBeCloseTo(0, 9);
    expect(dot(cross(pose.right, pose.down), pose.forward)).toBeCloseTo(1, 9);
});

test('the direction of view stays clear of straight up and down', () => {
    const pose = new Pose([0, 1, 0]);
    pose.lookAt([0, 0, -5]);
    for (let i = 0; i < 100; i++) pose.turn(0, 0.1);
    const low = dot(pose.forward, pose.up);
    for (let i = 0; i < 100; i++) pose.turn(0, -0.1);
    const high = dot(pose.forward, pose.up);
    expect(low).toBeLessThan(-0.999);
    expect(high).toBeGreaterThan(0.999);
    expect(Math.max(-low, high)).toBeLessThan(1);
});

test('a yaw turns the view to the right, a pitch downwards', () => {
    const pose = new Pose([0, 1, 0]);
    pose.lookAt([0, 0, -5]);
    pose.turn(0.1, 0.1, true);
    expect(pose.forward[0]).toBeGreaterThan(0.05);
    expect(pose.forward[1]).toBeLessThan(-0.05);
    expect(centreOf({ rotation: pose.view(1, 1).rotation, translation: pose.view(1, 1).translation })).toEqual([0, 0, 0].map((v) => expect.closeTo(v, 9)) as unknown as Vec3);
});

test('the first view covers the viewport; one of quite another shape, up to twice as large as whole', () => {
    expect(fitted(CAMERA, 400, 600, true)).toEqual({ scale: 2, x: -200, y: 0 });
    expect(fitted(CAMERA, 400, 1500, true).scale).toBe(2);
    const info = { worldFromData: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], cameras: [CAMERA], home: 0 } as unknown as SceneInfo;
    const pose = homePose(info, { centre: [0, 0, 0], radius: 1 });
    expect(pose.view(400, 600).focalPx).toEqual([700, 680]);
    pose.goTo(CAMERA);
    expect(pose.view(400, 600).focalPx).toEqual([350, 340]);
});

/** Where a view shows a point, px. */
function shown(pose: Pose, point: Vec3): [number, number] {
    const { focalPx, principalPx } = pose.view(400, 300);
    const [x, y, z] = [pose.right, pose.down, pose.forward].map((axis) => dot(axis, [0, 1, 2].map((i) => point[i] - pose.centre[i]) as Vec3));
    return [focalPx[0] * x / z + principalPx[0], focalPx[1] * y / z + principalPx[1]];
}

test('zooming keeps what is under the pointer there', () => {
    const pose = new Pose();
    pose.goTo(CAMERA);
    pose.distance = 4;
    const view = pose.view(400, 300), at = [310, 40] as const;
    // At the distance of the target, under that pixel.
    const slope = [(at[0] - view.principalPx[0]) / view.focalPx[0], (at[1] - view.principalPx[1]) / view.focalPx[1]];
    const point = [0, 1, 2].map((i) => pose.centre[i] + 4 * (pose.forward[i] + slope[0] * pose.right[i] + slope[1] * pose.down[i])) as Vec3;
    pose.dollyTo(at, view, 0.5);
    expect(pose.distance).toBeCloseTo(2, 12);
    shown(pose, point).forEach((px, i) => expect(px).toBeCloseTo(at[i], 9));
    // Control: towards the middle it would move.
    pose.dolly(0.5);
    expect(Math.abs(shown(pose, point)[0] - at[0])).toBeGreaterThan(20);
});

test('what was asked for is done over some images, all of it in the end', () => {
    const [gliding, atOnce] = [new Pose(), new Pose()];
    const glide = new Glide(), other = new Glide();
    for (const one of [glide, other]) {
        one.turn(0.3, 0.1);
        one.shift(0.2, -0.1);
    }
    other.advance(atOnce, 1 / 60, false, true);
    expect(other.isMoving).toBe(false);
    glide.advance(gliding, 1 / 60, false, false);
    expect(glide.isMoving).toBe(true);
    expect(dot(gliding.forward, atOnce.forward)).toBeLessThan(0.99);
    for (let i = 0; i < 60; i++) glide.advance(gliding, 1 / 60, false, false);
    expect(glide.isMoving).toBe(false);
    expect(dot(gliding.forward, atOnce.forward)).toBeGreaterThan(0.999);
    glide.turn(1, 0);
    glide.stop();
    expect(glide.isMoving).toBe(false);
});

test('the camera stays where photos were taken', () => {
    const at = (x: number): SceneCamera => ({ ...CAMERA, rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], translation: [-x, 0, 0] });
    const cameras = [at(-1), at(1)]; // one unit from their middle
    const pose = new Pose();
    pose.goTo(cameras[1]);
    pose.distance = 3;
    pose.centre = [1, 0, 0.2];
    keepNear(pose, cameras, 0.3);
    expect(pose.centre).toEqual([1, 0, 0.2]);
    expect(pose.distance).toBe(3);
    pose.centre = [1, 0, 2];
    keepNear(pose, cameras, 0.3);
    pose.centre.forEach((c, i) => expect(c).toBeCloseTo([1, 0, 0.3][i], 12));
    expect(pose.target[2]).toBeCloseTo(5, 12); // the target has stayed
    keepNear(pose, [], 0.3);
    expect(pose.centre[2]).toBeCloseTo(0.3, 12);
});

test('a sphere is as large in an image as its outline', () => {
    expect(radiusPx(1, Math.SQRT2, 100)).toBeCloseTo(100, 9);
    expect(radiusPx(0.01, 10, 500)).toBeCloseTo(0.5, 4);
    expect([radiusPx(2, 1, 100), radiusPx(2, 2, 100)]).toEqual([Infinity, Infinity]);
});
