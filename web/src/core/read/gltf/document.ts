import { check, support } from '../errors';
import { type Json, listOf, objectOf, textOf, wholeOf } from '../json';
import { EXTENSION, KHR } from './names';

export { EXTENSION, KHR };

/** Extensions that a file may require. */
const UNDERSTOOD = [KHR, EXTENSION, 'KHR_mesh_quantization', 'KHR_materials_unlit'];

/** Most splats. */
const COUNT_MAX = 2 ** 24;

type Numbers = Int8Array | Uint8Array | Int16Array | Uint16Array | Uint32Array | Float32Array;

/** Arrays by `componentType`. */
const KINDS: Readonly<Record<string, { readonly BYTES_PER_ELEMENT: number; new (buffer: ArrayBuffer): Numbers }>> = {
    5120: Int8Array,
    5121: Uint8Array,
    5122: Int16Array,
    5123: Uint16Array,
    5125: Uint32Array,
    5126: Float32Array,
};
export const I8 = 5120;
export const U8 = 5121;
export const I16 = 5122;
export const U16 = 5123;
export const F32 = 5126;

/** Where bytes lie in the binary chunk. */
export interface View {
    readonly offset: number;
    readonly bytes: number;
    readonly stride: unknown;
}

/** Where an array lies in the binary chunk. */
export interface Accessor {
    readonly component: number;
    readonly normalised: boolean;
    /** Numbers of an element. */
    readonly width: number;
    /** Elements. */
    readonly count: number;
    /** Of the first element, and bytes from one to the next. */
    readonly offset: number;
    readonly stride: number;
    /** Behind the last element. */
    readonly end: number;
}

/** The JSON of a `.glb`, whose look-ups are checked. Names are for messages. */
export class Document {
    /** `binBytes`: bytes of the binary chunk. */
    constructor(
        readonly root: Json,
        private readonly binBytes: number,
    ) {
        const asset = objectOf(root.asset, 'asset');
        const version = String(asset.minVersion ?? asset.version);
        support(asset.minVersion === undefined ? version.startsWith('2.') : version === '2.0', 'version of glTF', version, '2.0');
        for (const name of this.list('extensionsRequired')) {
            support(UNDERSTOOD.includes(name as string), 'required extension', name, UNDERSTOOD.join());
        }
    }

    /** A list of the root; empty if it is absent. */
    list(name: string): readonly unknown[] {
        return listOf(this.root[name] ?? [], name);
    }

    /** An object of a list of the root. */
    at(list: string, index: unknown, name: string): Json {
        const all = this.list(list);
        return objectOf(all[wholeOf(index, name, all.length - 1)], name);
    }

    view(index: unknown, name: string): View {
        const view = this.at('bufferViews', index, name);
        const buffer = this.at('buffers', view.buffer, name);
        support(buffer.uri === undefined, name, 'a buffer in another file', 'all in one .glb file');
        const declared = wholeOf(buffer.byteLength, name);
        const offset = wholeOf(view.byteOffset ?? 0, name);
        const bytes = wholeOf(view.byteLength, name);
        const fits = view.buffer === 0 && declared <= this.binBytes && offset + bytes <= declared;
        check(fits, `end of ${name}`, offset + bytes, `at most ${Math.min(declared, this.binBytes)}`);
        return { offset, bytes, stride: view.byteStride };
    }

    accessor(index: unknown, name: string): Accessor {
        const accessor = this.at('accessors', index, name);
        support(accessor.sparse === undefined && accessor.bufferView !== undefined, name, 'a sparse accessor', 'plain ones');
        const view = this.view(accessor.bufferView, name);
        const component = wholeOf(accessor.componentType, name);
        const type = textOf(accessor.type, name);
        const width = ['', 'SCALAR', 'VEC2', 'VEC3', 'VEC4'].indexOf(type);
        check(component in KINDS && width > 0, `type of ${name}`, `${component} ${type}`, 'numbers or vectors');
        const size = width * KINDS[component].BYTES_PER_ELEMENT;
        const stride = wholeOf(view.stride ?? size, name, Math.max(252, size));
        const count = wholeOf(accessor.count, name, COUNT_MAX);
        const offset = wholeOf(accessor.byteOffset ?? 0, name);
        const end = offset + stride * (count - 1) + size;
        check(count > 0 && stride >= size && end <= view.bytes, `bytes of ${name}`, view.bytes, `at least ${end}`);
        return { component, normalised: accessor.normalized === true, width, count, offset: view.offset + offset, stride, end: view.offset + end };
    }
}

/** The numbers of all elements; floats bit for bit, normalised integers as -1 to 1 or 0 to 1. */
export function numbersAt(bin: Uint8Array, { component, normalised, width, count, offset, stride }: Accessor): Float32Array {
    const Kind = KINDS[component];
    const size = width * Kind.BYTES_PER_ELEMENT;
    const packed = bin.slice(offset, offset + size * count);
    for (let i = 1, at = offset + stride; stride > size && i < count; i += 1, at += stride) {
        packed.set(bin.subarray(at, at + size), size * i);
    }
    const numbers = new Kind(packed.buffer);
    if (numbers instanceof Float32Array) return numbers;
    // The largest number stands for 1.
    const one = normalised ? 2 ** (8 * Kind.BYTES_PER_ELEMENT - (component === I8 || component === I16 ? 1 : 0)) - 1 : 1;
    return Float32Array.from(numbers, (value) => (normalised ? Math.max(value / one, -1) : value));
}
