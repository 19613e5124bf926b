// Reads and writes glTF as JSON and arrays, from the glTF 2.0 specification alone: shares no code with the project.

import { readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';

export const KHR = 'KHR_gaussian_splatting';
export const OURS = 'LITETEX_gaussian_splatting_texture';

const ARRAYS = { 5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array };
const WIDTHS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };

/** `{json, bin}` of a .glb, or of a .gltf with one external buffer. */
export function read(path) {
    const bytes = readFileSync(path);
    if (!path.endsWith('.glb')) {
        const json = JSON.parse(bytes);
        return { json, bin: readFileSync(join(dirname(path), decodeURIComponent(json.buffers[0].uri))) };
    }
    const length = bytes.readUInt32LE(12);
    return { json: JSON.parse(bytes.subarray(20, 20 + length)), bin: Buffer.from(bytes.subarray(28 + length)) };
}

/** Writes a .glb. */
export function write(path, { json, bin }) {
    const text = Buffer.from(JSON.stringify(json));
    const chunk = (data, fill, type) => {
        const size = Math.ceil(data.length / 4) * 4;
        const head = Buffer.alloc(8);
        head.writeUInt32LE(size, 0);
        head.write(type, 4, 'latin1');
        return Buffer.concat([head, data, Buffer.alloc(size - data.length, fill)]);
    };
    const chunks = Buffer.concat([chunk(text, ' ', 'JSON'), chunk(bin, 0, 'BIN\0')]);
    const head = Buffer.alloc(12);
    head.write('glTF', 0, 'latin1');
    head.writeUInt32LE(2, 4);
    head.writeUInt32LE(12 + chunks.length, 8);
    writeFileSync(path, Buffer.concat([head, chunks]));
}

/** A deep copy. */
export function copy({ json, bin }) {
    return { json: structuredClone(json), bin: Buffer.from(bin) };
}

/** The only primitive. */
export function primitive({ json }) {
    return json.meshes[0].primitives[0];
}

/** `{array, width, count, normalized}` of an accessor; the array is a copy. */
export function accessor({ json, bin }, index) {
    const { bufferView, byteOffset = 0, componentType, type, count, normalized = false } = json.accessors[index];
    const view = json.bufferViews[bufferView];
    const [Type, width] = [ARRAYS[componentType], WIDTHS[type]];
    const element = width * Type.BYTES_PER_ELEMENT;
    const stride = view.byteStride ?? element;
    const packed = new Uint8Array(count * element);
    for (let i = 0; i < count; i++) {
        const at = (view.byteOffset ?? 0) + byteOffset + i * stride;
        packed.set(bin.subarray(at, at + element), i * element);
    }
    return { array: new Type(packed.buffer), width, count, normalized };
}

/** Replaces each value of an accessor, in place, with `change(value, component index)`. */
export function edit(file, index, change) {
    const { array, width, count } = accessor(file, index);
    const { bufferView, byteOffset = 0 } = file.json.accessors[index];
    const view = file.json.bufferViews[bufferView];
    const element = width * array.BYTES_PER_ELEMENT;
    const changed = array.map((v, i) => change(v, i % width));
    const bytes = Buffer.from(changed.buffer);
    for (let i = 0; i < count; i++) {
        bytes.copy(file.bin, (view.byteOffset ?? 0) + byteOffset + i * (view.byteStride ?? element), i * element, (i + 1) * element);
    }
}
