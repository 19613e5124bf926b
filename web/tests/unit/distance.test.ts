import { expect, test } from 'vitest';
import { pick } from '../../src/core/pick';
import { readMeta } from '../../src/core/read/meta';
import { viewOf } from '../../src/core/render/view';
import type { SceneInfo } from '../../src/core/scene';
import { distanceOf, placeOf, scaleOption } from '../../src/page/distance';
import { pointAt, rayThrough } from '../../src/viewer/ray';
import type { Vec3 } from '../../src/viewer/vector';
import { file, outcomeOf } from './scenes';

const HALF = Math.SQRT1_2;
const META = {
    near: 0.25, filter: 'ewa', background: [0, 0, 0], colourSpace: 'srgb_rec709_display', cameras: [],
    // A quarter turn about z: x of the local frame is y of the capture.
    captureFromLocal: { scale: 2, rotation: [HALF, 0, 0, HALF], translation: [10, 20, 30] },
    provenance: { title: '', author: '', licence: '', source: '', programVersion: '', training: {} },
};
const infoOf = (meta: object) => readMeta({ ...META, ...meta }) as SceneInfo;

test('points are told in the frame of the capture, their distance in that of the world', () => {
    const worldFromCapture = { scale: 3, rotation: [0, 1, 0, 0], translation: [7, 8, 9] };
    const info = infoOf({ worldFromCapture });
    // y and z of the data are those of the local frame reversed.
    const points: [Vec3, Vec3] = [[0, 0, 0], [1, -2, -3]];
    expect(scaleOption(info, points, '')).toBe("--scale-from '10.000000,20.000000,30.000000 6.000000,22.000000,36.000000 = ...m'");
    expect(distanceOf(info, points)).toEqual({ distance: expect.closeTo(3 * 2 * Math.sqrt(14), 9), unit: 'units, unknown scale' });
    const metric = infoOf({ provenance: { ...META.provenance, scale: 'metres: 1 m between two points' } });
    expect(distanceOf(metric, points)).toEqual({ distance: expect.closeTo(2 * Math.sqrt(14), 9), unit: 'm' });
    // Negative controls: what a file says otherwise are not metres; a file of another program knows no capture.
    expect(distanceOf(infoOf({ provenance: { ...META.provenance, scale: 'unknown scale' } }), points).unit).toBe('units, unknown scale');
    expect(scaleOption({ ...info, captureFromData: null }, points, '1m')).toBe('');
    expect(() => infoOf({ provenance: { ...META.provenance, scale: 5 } })).toThrow(/a text/);
});

test('lengths are those that the program takes', () => {
    const info = infoOf({});
    const lengths = (text: string) => / = (.*)'$/.exec(scaleOption(info, [[0, 0, 0], [1, 0, 0]], text))![1];
    expect(['1.2', ' 1.20 m', '12in', '.5ft', '30 mm', '4cm'].map(lengths)).toEqual(['1.2m', '1.20m', '12in', '.5ft', '30mm', '4cm']);
    expect(['', 'm', '0m', '-1m', '1 mile', "1m'; rm", '1e400m'].map(lengths)).toEqual(Array(7).fill('...m'));
});

test('small distances far from the origin keep their digits', () => {
    const info = infoOf({ captureFromLocal: { scale: 1, rotation: [1, 0, 0, 0], translation: [500_000, 4_000_000, 100] } });
    const [, a, b] = /'(\S+) (\S+) /.exec(scaleOption(info, [[0, 0, 0], [0.001, 0, 0]], '1'))!;
    const [x, y] = [a, b].map((point) => Number(point.split(',')[0]));
    expect(y - x).toBeCloseTo(0.001, 8);
});

test('the point under a pixel is seen there', async () => {
    const { info, splats } = await outcomeOf(file('samples/conformance/balanced.ltgs'));
    const view = viewOf(info!.cameras[0], 400, 300);
    const parts = [{ first: 0, splats: splats! }];
    let met = 0;
    for (let x = 10; x < 400; x += 40) {
        for (let y = 10; y < 300; y += 40) {
            const ray = rayThrough(view, [x, y], info!.near);
            const found = pick(parts, ray);
            if (!found) continue;
            met++;
            const [px, py] = placeOf(view, pointAt(ray, found.distance))!;
            expect(Math.hypot(px - x, py - y)).toBeLessThan(1e-6);
        }
    }
    expect(met).toBeGreaterThan(10);
    expect(met).toBeLessThan(80);
    // Behind the camera nothing is seen.
    const ray = rayThrough(view, [200, 150], info!.near);
    expect(placeOf(view, pointAt(ray, -1))).toBeNull();
});
