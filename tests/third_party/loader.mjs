// Validates the point fallback with the GLTFLoader of three.js, here without its splat extension: it must load points with
// the right counts, positions and colours in linear light.
//
//     node loader.mjs FILE.glb...

import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import { Matrix4, Quaternion, Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { KHR, accessor, copy, edit, primitive, read, write } from './gltf.mjs';
import { finish } from './report.mjs';

const SH_0 = 0.28209479177387814;
// Half a step of 16 bits, and the rounding of f32. Colours of 8 bits are rounded from those of 16.
const COLOUR_TOLERANCE = 0.5 / 65535 + 1e-6;
const U8 = 5121;

function linearFromSrgb(v) {
    return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
}

function load(path) {
    const bytes = readFileSync(path);
    const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
    return new Promise((resolve, reject) => new GLTFLoader().parse(buffer, '', resolve, reject));
}

/** `{problems, worst, count}` of a file: `worst` is the largest colour error. */
async function validate(path) {
    const name = basename(path);
    const file = read(path);
    const attributes = primitive(file).attributes;
    const count = file.json.accessors[attributes.POSITION].count;
    const gltf = await load(path);
    const points = [];
    gltf.scene.traverse((object) => (object.isPoints || object.isMesh || object.isLine) && points.push(object));
    if (points.length !== 1 || !points[0].isPoints) return { problems: [`${name}: ${points.map((p) => p.type)}, expected Points`] };
    const problems = [];
    for (const [semantic, index] of Object.entries(attributes)) {
        const found = points[0].geometry.getAttribute({ POSITION: 'position', COLOR_0: 'color' }[semantic] ?? semantic.toLowerCase());
        const { array, width } = accessor(file, index);
        if (found?.count !== count || found.itemSize !== width || array.length !== width * count) {
            problems.push(`${name}: ${semantic}: ${found?.count} x ${found?.itemSize}, expected ${count} x ${width}`);
        }
    }
    const [geometry, isDisplay] = [points[0].geometry, primitive(file).extensions[KHR].colorSpace === 'srgb_rec709_display'];
    const [dc, opacity] = ['SH_DEGREE_0_COEF_0', 'OPACITY'].map((n) => accessor(file, attributes[`${KHR}:${n}`]).array);
    let worst = 0;
    for (let i = 0; i < count; i++) {
        for (let c = 0; c < 4; c++) {
            const display = c < 3 ? Math.min(1, Math.max(0, 0.5 + SH_0 * dc[3 * i + c])) : opacity[i];
            const expected = c < 3 && isDisplay ? linearFromSrgb(display) : display;
            worst = Math.max(worst, Math.abs(geometry.getAttribute('color').getComponent(i, c) - expected));
        }
    }
    const has8Bits = file.json.accessors[attributes.COLOR_0].componentType === U8;
    if (!(worst <= COLOUR_TOLERANCE + (has8Bits ? 0.5 / 255 : 0))) problems.push(`${name}: COLOR_0 is off by up to ${worst}`);

    const node = file.json.nodes[0];
    const world = new Matrix4().compose(...[
        new Vector3(...(node.translation ?? [0, 0, 0])), new Quaternion(...(node.rotation ?? [0, 0, 0, 1])),
        new Vector3(...(node.scale ?? [1, 1, 1]))]);
    gltf.scene.updateMatrixWorld(true);
    const off = Math.max(...world.elements.map((v, i) => Math.abs(v - points[0].matrixWorld.elements[i])));
    const bounds = file.json.accessors[attributes.POSITION];
    const position = geometry.getAttribute('position');
    for (let i = 0; i < count; i++) {
        for (let c = 0; c < 3; c++) {
            const v = position.getComponent(i, c);
            if (!(v >= bounds.min[c] && v <= bounds.max[c])) return { problems: [`${name}: splat ${i} lies outside the bounds`] };
        }
    }
    if (off > 1e-9) problems.push(`${name}: the node's transform differs by ${off}`);
    return { problems, worst, count };
}

/** Negative controls: each must be caught. */
const BREACHES = {
    'colours not in linear light': (f) => edit(f, primitive(f).attributes.COLOR_0, (v, c) =>
        Math.round(c < 3 ? 65535 * (v / 65535) ** (1 / 2.2) : v)),
    '8-bit opacity': (f) => edit(f, primitive(f).attributes.COLOR_0, (v, c) => (c < 3 ? v : 257 * Math.round(v / 257))),
    'lines instead of points': (f) => (primitive(f).mode = 1),
    'one scale missing': (f) => f.json.accessors[primitive(f).attributes[`${KHR}:SCALE`]].count--,
    'positions moved': (f) => edit(f, primitive(f).attributes.POSITION, (v) => v + 1),
};

const files = process.argv.slice(2);
const problems = [];
let [worst, points] = [0, 0];
for (const path of files) {
    const found = await validate(path);
    problems.push(...found.problems);
    worst = Math.max(worst, found.worst ?? 0);
    points += found.count ?? 0;
}
for (const [name, breach] of Object.entries(BREACHES)) {
    const file = copy(read(files[0]));
    breach(file);
    const path = files[0].replace(/\.glb$/, '.broken.glb');
    write(path, file);
    const caught = await validate(path).then((found) => found.problems.length > 0, () => true);
    if (!caught) problems.push(`control "${name}" was not caught`);
}
finish('three GLTFLoader', `${files.length} files, ${points} points, COLOR_0 off by at most ${(65535 * worst).toFixed(2)}/65535; `
    + `${Object.keys(BREACHES).length} controls caught`, problems);
