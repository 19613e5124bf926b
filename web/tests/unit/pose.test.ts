import { expect, test } from 'vitest';
import type { SceneCamera, SceneInfo } from '../../src/core/scene';
import { centreOf, viewOf } from '../../src/core/render/view';
import { fitted, homePose, Pose } from '../../src/viewer/pose';
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
