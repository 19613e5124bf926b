import { describe, expect, test } from 'vitest';
import { contentHash } from '../../src/core/read/hash';
import type { SceneInfo, Splats } from '../../src/core/scene';
import { file, join, messageOf, ours, outcomeOf, split } from './scenes';

const KHR = 'KHR_gaussian_splatting';
const lossless = file('samples/conformance/lossless.glb');
const balanced = file('samples/conformance/balanced.glb');
const tiny = file('web/tests/data/tiny.glb');

type Change = (json: any, bin: Uint8Array) => void;

/** The outcome of a file whose JSON or bytes are changed. */
async function changed(glb: Uint8Array, change: Change): ReturnType<typeof outcomeOf> {
    const { json, bin } = split(glb);
    const copy = bin.slice();
    change(json, copy);
    return outcomeOf(join(json, copy));
}

const primitive = (json: any): any => json.meshes[0].primitives[0];
const messageAfter = async (glb: Uint8Array, change: Change): Promise<string> => messageOf((await changed(glb, change)).error);

/** The hash that a file states. */
const hashOf = (glb: Uint8Array): string => ours(split(glb).json).hash;

describe.each([['lossless', lossless], ['balanced', balanced], ['tiny', tiny]])('%s.glb', (quality, bytes) => {
    test('its content has the hash that it states, in pieces of any size', async () => {
        for (const pieceBytes of [undefined, 100, 5000]) {
            const { info, splats, updates, warnings, error } = await outcomeOf(bytes, {}, pieceBytes);
            expect([error, warnings]).toEqual([null, []]);
            expect(contentHash([splats!], info!)).toBe(hashOf(bytes));
            expect(info).toMatchObject({ container: 'gltf', quality, splats: splats!.count, untextured: null, fileBytes: bytes.length });
            expect(updates.at(-1)!.complete).toBe(true);
        }
    });

    test('negative control: a changed bit gives another hash or an error', async () => {
        const { json, bin } = split(bytes);
        const view = json.bufferViews[ours(json).stream?.bufferView ?? json.accessors[primitive(json).attributes.POSITION].bufferView];
        const { warnings, error } = await changed(bytes, (_, all) => {
            all[(view.byteOffset ?? 0) + (view.byteLength >> 1)] ^= 1;
        });
        expect(bin.length).toBeGreaterThan(0);
        if (quality === 'tiny') expect(messageOf(error)).toContain('checksum');
        else expect(warnings).toEqual(['the content does not match its hash: a program has changed values']);
    });

    test('every beginning of it is an error', async () => {
        const { json, bin } = split(bytes);
        const view = json.bufferViews[ours(json).stream?.bufferView];
        // Behind the stream stand arrays for other programs, which are not waited for.
        const end = view === undefined ? bytes.length : bytes.length - bin.length + (view.byteOffset ?? 0) + view.byteLength;
        for (let cut = 0; cut < end; cut += Math.ceil(end / 80)) {
            expect(messageOf((await outcomeOf(bytes.slice(0, cut))).error)).toMatch(cut < 4 ? /^unsupported/ : /^invalid: truncated/);
        }
    });
});

test('the first splats are enough', async () => {
    for (const [glb, count] of [[lossless, 36], [tiny, 3]] as const) {
        const { splats } = await outcomeOf(glb, { maxSplats: 2 });
        const whole = (await outcomeOf(glb)).splats!;
        expect([splats!.count, whole.count]).toEqual([2, count]);
        expect(splats!.sh).toEqual(whole.sh.slice(0, splats!.sh.length));
        expect(splats!.texels.length).toBe(3 * (whole.rows[0] * whole.cols[0] + whole.rows[1] * whole.cols[1]));
    }
});

test('the same scene in both containers has the same cameras and place', async () => {
    const { info } = await outcomeOf(lossless);
    const other = (await outcomeOf(file('samples/conformance/balanced.ltgs'))).info!;
    const near = (a: readonly number[], b: readonly number[], digits: number): void => a.forEach((v, i) => expect(v).toBeCloseTo(b[i], digits));
    near(info!.worldFromData, other.worldFromData, 12);
    info!.cameras.forEach((camera, i) => {
        // Within 5e-5, which is 0.006 pixels here.
        near(camera.rotation, other.cameras[i].rotation, 4);
        near(camera.translation, other.cameras[i].translation, 4);
        expect(camera).toMatchObject({ name: other.cameras[i].name, focalPx: other.cameras[i].focalPx });
    });
    expect([info!.near, info!.background, info!.provenance]).toEqual([other.near, other.background, other.provenance]);
});

test('an embedded file is shown while it arrives', async () => {
    const { updates } = await outcomeOf(tiny, {}, 16);
    expect(updates.length).toBeGreaterThan(1);
    expect(updates[0].complete).toBe(false);
});

describe('a file of arrays', () => {
    test.each([['lossless', lossless], ['balanced', balanced]])('%s.glb is shown before its textures and view-dependent colours are there', async (_, bytes) => {
        const whole = await outcomeOf(bytes);
        expect(whole.updates.length).toBe(1);
        const { updates, splats, info } = await outcomeOf(bytes, {}, 1000);
        expect([splats, info]).toEqual([whole.splats, whole.info]);
        const [first, last] = updates;
        expect([updates.length, first.complete, last.complete]).toEqual([2, false, true]);
        expect(first.bytes).toBeLessThan(bytes.length / 2);
        const { count, positions, rotations, scales, opacities, sh, shDegrees, rows, texels } = first.splats;
        const { splats: all } = last;
        expect([count, positions, rotations, scales, opacities]).toEqual([all.count, all.positions, all.rotations, all.scales, all.opacities]);
        expect([shDegrees.some((degree) => degree > 0), rows.some((side) => side > 0), texels.length]).toEqual([false, false, 0]);
        // With the means of maps: another colour where there is one, the same elsewhere.
        let at = 0;
        const isSame = Array.from(all.shDegrees, (degree, i) => {
            const own = [0, 1, 2].every((c) => all.sh[at + c] === sh[3 * i + c]);
            at += 3 * (degree + 1) ** 2;
            return own;
        });
        expect(isSame.every((same, i) => same || all.rows[i] > 0)).toBe(true);
        expect(isSame).toContain(false);
        expect((await outcomeOf(bytes, { maxSplats: 2 }, 1000)).updates.map((update) => update.splats.count)).toEqual([2, 2]);
    });

    test('one of which the number of texels is not known, or whose attributes stand last, is shown at the end', async () => {
        const updatesOf = async (change: Change): Promise<number> => {
            const { json, bin } = split(balanced);
            change(json, bin);
            const { updates, error } = await outcomeOf(join(json, bin), {}, 1000);
            expect(error).toBeNull();
            return updates.length;
        };
        expect(await updatesOf(() => {})).toBe(2);
        expect(await updatesOf((json) => delete primitive(json).extras)).toBe(1);
        expect(await updatesOf((json) => (primitive(json).extras.litetex.splats += 1))).toBe(1);
        const { json, bin } = split(balanced);
        const view = json.bufferViews[json.accessors[primitive(json).attributes.POSITION].bufferView];
        const { byteOffset = 0 } = view;
        const moved = Uint8Array.from([...bin, ...bin.slice(byteOffset, byteOffset + view.byteLength)]);
        view.byteOffset = bin.length;
        json.buffers[0].byteLength = moved.length;
        const { updates, splats } = await outcomeOf(join(json, moved), {}, 1000);
        expect([updates.length, splats]).toEqual([1, (await outcomeOf(balanced)).splats]);
    });

    test('its digest is right, whether it is read at once or not', async () => {
        const { json, bin } = split(balanced);
        primitive(json).extras.litetex.texels += 1;
        for (const pieceBytes of [undefined, 1000]) expect(messageOf((await outcomeOf(join(json, bin), {}, pieceBytes)).error)).toContain('texels of the digest');
        primitive(json).extras.litetex.texels = 4e9;
        expect(messageOf((await outcomeOf(join(json, bin), {}, 1000)).error)).toMatch(/^unsupported: bytes of/);
    });

    test('without textures it needs no digest', async () => {
        const { json, bin } = split(balanced);
        delete primitive(json).extensions[KHR].extensions;
        const { updates, info } = await outcomeOf(join(json, bin), {}, 1000);
        expect([updates.length, info!.texels]).toEqual([2, 0]);
    });
});

test('maps on several pages', async () => {
    const whole = (await outcomeOf(lossless)).splats!;
    const { json, bin } = split(lossless);
    // Every other map on a second page, which is a copy of the first.
    const pages = new Uint8Array(36).map((_, i) => i % 2);
    json.bufferViews.push({ buffer: 0, byteOffset: bin.length, byteLength: 36 });
    json.accessors.push({ bufferView: json.bufferViews.length - 1, componentType: 5121, type: 'SCALAR', count: 36 });
    json.buffers[0].byteLength = bin.length + 36;
    ours(json).pages = json.accessors.length - 1;
    ours(json).atlas.push(ours(json).atlas[0]);
    const { splats, warnings } = await outcomeOf(join(json, Uint8Array.from([...bin, ...pages])));
    expect(warnings).toEqual([]);
    expect(splats).toEqual(whole);
});

describe('nodes', () => {
    const place = async (change: (nodes: any[]) => void): Promise<SceneInfo['worldFromData']> =>
        (await changed(lossless, (json) => change(json.nodes))).info!.worldFromData;

    test('a hierarchy of transforms and matrices', async () => {
        const matrix = [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 1, 2, 3, 1];
        const world = await place((nodes) => {
            const scaled = { mesh: 0, translation: [1, 0, 0], scale: [0.5, 0.5, 0.5] };
            nodes.splice(0, Infinity, scaled, { children: [0], matrix }, { children: [1], rotation: [0, 1, 0, 0] });
        });
        // x, y, z -> 0.5 x + 1, ... -> 2 z + 1, 2 y + 2, -2 x + 3 -> half a turn about y.
        expect(world.map((v) => Math.round(1e9 * v) / 1e9 + 0)).toEqual([0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0, -1, 2, -1, 1]);
    });

    test('without a node, the metadata tell the place', async () => {
        const [there, gone] = [await place(() => {}), await place((nodes) => nodes.splice(0, Infinity))];
        gone.forEach((v, i) => expect(v).toBeCloseTo(there[i], 9));
    });

    test.each([
        ['two nodes', (nodes: any[]) => nodes.push({ mesh: 0 }), 'nodes of the splats'],
        ['a mirror', (nodes: any[]) => (nodes[0].scale = [-1, 1, 1]), 'transform of the node'],
        ['another scale along an axis', (nodes: any[]) => (nodes[0].scale = [1, 1, 1.1]), 'transform of the node'],
        ['a shear', (nodes: any[]) => (nodes[0] = { mesh: 0, matrix: [1, 0, 0, 0, 0.1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }), 'transform of the node'],
        ['scale 0', (nodes: any[]) => (nodes[0].scale = [0, 0, 0]), 'transform of the node'],
        ['a long quaternion', (nodes: any[]) => (nodes[0].rotation = [0, 0, 0, 2]), 'rotation of a node'],
        ['its own child', (nodes: any[]) => (nodes[0].children = [0]), 'ancestors of a node'],
        ['two parents', (nodes: any[]) => nodes.push({ children: [0] }, { children: [0] }), 'parents of a node'],
        ['a missing child', (nodes: any[]) => (nodes[0].children = [7]), 'child'],
    ])('%s', async (_, change, words) => {
        expect(await messageAfter(lossless, (json) => change(json.nodes))).toContain(words);
    });
});

describe('without textures', () => {
    const drop: Change = (json) => {
        delete primitive(json).extensions[KHR].extensions;
    };

    test('a program that dropped them is told of', async () => {
        const { info, splats, error } = await changed(balanced, drop);
        expect(error).toBeNull();
        expect(info!.untextured).toContain('dropped the textures');
        expect(info).toMatchObject({ quality: '', texels: 0, splats: 36, shDegree: 3, filter: 'none', cameras: [] });
        expect(info!.provenance.programVersion).toMatch(/^litetex/);
        expect([splats!.count, splats!.texels.length]).toEqual([36, 0]);
    });

    test.each([2, 4])('extension of version %i', async (version) => {
        const { info, splats } = await changed(balanced, (json) => (ours(json).version = version));
        expect(info!.untextured).toContain(`of version ${version}`);
        expect(splats!.count).toBe(36);
    });

    const foreign: Change = (json) => {
        drop(json, new Uint8Array(0));
        delete primitive(json).extras;
    };

    /** Numbers of an attribute in the binary chunk. */
    const numbers = (json: any, bin: Uint8Array, name: string): Float32Array => {
        const { bufferView } = json.accessors[primitive(json).attributes[`${KHR}:${name}`]];
        const { byteOffset = 0, byteLength } = json.bufferViews[bufferView];
        return new Float32Array(bin.buffer, bin.byteOffset + byteOffset, byteLength / 4);
    };

    test('discs of another program', async () => {
        const { info, splats, error } = await changed(balanced, foreign);
        expect([error, info!.untextured]).toEqual([null, null]);
        const { splats: expected } = await changed(balanced, drop);
        expect(splats).toEqual(expected);
    });

    test('ellipsoids are refused, zeros are not', async () => {
        const thick: Change = (json, bin) => {
            foreign(json, bin);
            numbers(json, bin, 'SCALE')[2] = numbers(json, bin, 'SCALE')[0] / 10;
        };
        expect(await messageAfter(balanced, thick)).toMatch(/^unsupported: third axis of an ellipsoid/);
        const flat: Change = (json, bin) => {
            foreign(json, bin);
            numbers(json, bin, 'SCALE').fill(0, 0, 3);
            numbers(json, bin, 'OPACITY')[0] = 0;
        };
        const { splats } = await changed(balanced, flat);
        expect([splats!.scales[0], splats!.opacities[0]]).toEqual([2 ** -126, 2 ** -126]);
    });

    test('attributes of integers', async () => {
        const { splats } = await changed(tiny, foreign);
        const textured = (await outcomeOf(tiny)).splats!;
        expect(splats!.positions).toEqual(textured.positions);
        splats!.rotations.forEach((v, i) => expect(Math.abs(v)).toBeCloseTo(Math.abs(textured.rotations[i]), 4));
        expect(splats!.sh.length).toBe(9);
    });

    test('no splats at all', async () => {
        const gone = (json: any): void => delete primitive(json).extensions as never;
        expect(await messageAfter(balanced, gone)).toContain('dropped the textures');
        expect(await messageAfter(balanced, (json) => (json.meshes = []))).toContain(`primitives with ${KHR}`);
    });
});

test.each<[string, Change, RegExp]>([
    ['lines', (json) => (primitive(json).mode = 1), /mode of splats/],
    ['two primitives', (json) => json.meshes[0].primitives.push(primitive(json)), /^unsupported: primitives/],
    ['a mesh of quads', (json) => Object.assign(primitive(json), { extensions: {}, extras: { litetex: { kind: 'quads' } } }), /^unsupported: this is a mesh of quads.*\.glb file/],
    ['an unknown required extension', (json) => (json.extensionsRequired = ['EXT_other']), /^unsupported: required extension/],
    ['another version of glTF', (json) => (json.asset.version = '3.0'), /^unsupported: version of glTF/],
    ['another colour space', (json) => (primitive(json).extensions[KHR].colorSpace = 'lin_rec709_display'), /colorSpace/],
    ['a missing attribute', (json) => delete primitive(json).attributes[`${KHR}:OPACITY`], /OPACITY/],
    ['a gap between SH coefficients', (json) => delete primitive(json).attributes[`${KHR}:SH_DEGREE_2_COEF_3`], /SH_DEGREE_2_COEF_3/],
    ['a sparse accessor', (json) => (json.accessors[0].sparse = {}), /sparse/],
    ['a count too large', (json) => (json.accessors[0].count = 37), /bytes of/],
    ['a count of 0', (json) => (json.accessors[0].count = 0), /bytes of/],
    ['a stride too small', (json) => (json.bufferViews[0].byteStride = 4), /bytes of/],
    ['a view behind the buffer', (json) => (json.bufferViews[0].byteOffset = 1e9), /end of/],
    ['a buffer longer than its chunk', (json) => (json.buffers[0].byteLength = 1e9), /end of/],
    ['a buffer in another file', (json) => (json.buffers[0].uri = 'a.bin'), /^unsupported.*in another file/],
    ['an image in another file', (json) => (json.images[0] = { uri: 'a.png' }), /^unsupported: image/],
    ['a page in another file', (json) => (ours(json).atlas[0] = { width: ours(json).atlas[0].width, height: ours(json).atlas[0].height, uri: 'a.exr' }), /^unsupported: page/],
    ['a page of another size', (json) => (ours(json).atlas[0].width += 1), /PNG: header/],
    ['a smaller page', (json) => (ours(json).atlas[0].width = 40), /map|texels/],
    ['no page', (json) => (ours(json).atlas = []), /map: found/],
    ['no scale of codes', (json) => delete ours(json).decode, /decode/],
    ['texel sizes without rectangles', (json) => delete ours(json).rects, /rects/],
    ['texel sizes of another type', (json) => (ours(json).texelSize = ours(json).rects), /texelSize/],
    ['no metadata', (json) => delete ours(json).meta, /meta/],
    ['a hash of other digits', (json) => (ours(json).hash = 'xyz'), /hash/],
    ['a near plane behind', (json) => (ours(json).meta.near = -1), /near/],
    ['a name that is no text', (json) => (ours(json).meta.cameras[0].name = {}), /camera/],
])('%s is refused', async (_, change, words) => {
    expect(await messageAfter(balanced, change)).toMatch(words);
});

test('texts of a file stay texts', async () => {
    const hostile = '<img src=x onerror=alert(1)>';
    const { info } = await changed(balanced, (json) => {
        const { meta } = ours(json);
        meta.provenance.title = hostile;
        meta.provenance.training = JSON.parse(`{"__proto__": "a", "constructor": "b"}`);
    });
    expect(info!.provenance.title).toBe(hostile);
    expect(Object.entries(info!.provenance.training)).toEqual([['__proto__', 'a'], ['constructor', 'b']]);
    expect(Object.getPrototypeOf(info!.provenance.training)).toBe(Object.prototype);
});

test('strided attributes', async () => {
    const whole = (await outcomeOf(lossless)).splats as Splats;
    const { json, bin } = split(lossless);
    const accessor = json.accessors[primitive(json).attributes.POSITION];
    const { byteOffset = 0 } = json.bufferViews[accessor.bufferView];
    const strided = new Uint8Array(36 * 20);
    for (let i = 0; i < 36; i += 1) strided.set(bin.subarray(byteOffset + 12 * i, byteOffset + 12 * (i + 1)), 20 * i + 4);
    json.bufferViews.push({ buffer: 0, byteOffset: bin.length, byteLength: strided.length, byteStride: 20 });
    Object.assign(accessor, { bufferView: json.bufferViews.length - 1, byteOffset: 4 });
    json.buffers[0].byteLength = bin.length + strided.length;
    const { splats, error } = await outcomeOf(join(json, Uint8Array.from([...bin, ...strided])));
    expect(error).toBeNull();
    expect(splats).toEqual(whole);
});
