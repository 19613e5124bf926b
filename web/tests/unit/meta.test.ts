import { expect, test } from 'vitest';
import { readMeta } from '../../src/core/read/meta';
import { homeCamera } from '../../src/viewer/pose';
import { sceneBounds } from '../../src/viewer/bounds';
import { file } from './scenes';
import { readScene } from '../../src/core/read';

const CAMERA = { name: 'a', widthPx: 4, heightPx: 3, focalPx: [3, 3], principalPx: [2, 1.5], rotationRows: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation: [0, 0, 0] };
const META = {
    near: 0.25, filter: 'ewa', background: [0, 0, 0], colourSpace: 'srgb_rec709_display', captureFromLocal: { scale: 1, rotation: [1, 0, 0, 0], translation: [0, 0, 0] },
    provenance: { title: '', author: '', licence: '', source: '', programVersion: '', training: {} }, cameras: [{ ...CAMERA, heldOut: true }, CAMERA, { ...CAMERA, name: 'b' }],
};

test('bounds of the local frame are turned to have y up', () => {
    const { bounds } = readMeta({ ...META, bounds: { min: [-1, -2, 3], max: [4, 5, 6] } });
    expect(bounds).toEqual({ min: [-1, -5, -6], max: [4, 2, -3] });
    expect(sceneBounds({ bounds }, () => { throw new Error('not needed'); }).centre).toEqual([1.5, -1.5, -4.5]);
    expect(readMeta(META).bounds).toBeNull();
    expect(() => readMeta({ ...META, bounds: { min: [1, 0, 0], max: [0, 0, 0] } })).toThrow(/min up to max/);
});

test('up is a text, absent where nobody chose one', () => {
    const of = (provenance: object) => readMeta({ ...META, provenance: { ...META.provenance, ...provenance } }).provenance.up;
    expect([of({}), of({ up: 'z: 12 of 12 photos are level to it' })]).toEqual(['', 'z: 12 of 12 photos are level to it']);
    expect(() => of({ up: 3 })).toThrow(/up.*a text/);
});

test('the home view is the one named, else the first of the training', async () => {
    const info = await readScene(file('samples/conformance/balanced.ltgs'));
    const of = (meta: object) => homeCamera({ ...info, ...readMeta({ ...META, ...meta }) })?.name;
    expect([of({ home: 2 }), of({}), of({ cameras: [] })]).toEqual(['b', 'a', undefined]);
    expect(() => readMeta({ ...META, home: 3 })).toThrow(/the index of a camera/);
});

test('the rotation of a camera is a matrix or a quaternion of any length', () => {
    const { rotationRows: _, ...rest } = CAMERA;
    const of = (camera: object) => readMeta({ ...META, cameras: [{ ...rest, ...camera }] }).cameras[0].rotation;
    // After half a turn about x, columns y and z have the other sign.
    const expected = [1, 0, 0, 0, -0.6, 0.8, 0, -0.8, -0.6];
    expect(of({ rotationRows: [[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]] })).toEqual(expected);
    of({ rotation: [2, 1, 0, 0] }).forEach((value, i) => expect(value).toBeCloseTo(expected[i], 15));
    of({ rotation: [-2, 1, 0, 0] }).slice(4, 8).forEach((value, i) => expect(value).toBeCloseTo([-0.6, -0.8, 0, 0.8][i], 15));
    expect(() => of({ rotation: [0, 0, 0, 0] })).toThrow(/rotation.*a quaternion/);
    expect(() => of({ rotation: [1, 0, 0] })).toThrow(/rotation.*4 numbers/);
    expect(() => of({})).toThrow(/rotationRows/);
});
