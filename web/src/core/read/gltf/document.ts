import { viewOf } from '../bytes';
import { invalid, quoted, unsupported } from '../errors';
import { type Json, listOf, objectOf, textOf, wholeOf } from '../json';

export const KHR = 'KHR_gaussian_splatting';
export const EXTENSION = 'LITETEX_gaussian_splatting_texture';

/** Extensions that a file may require. */
const UNDERSTOOD = [KHR, EXTENSION, 'KHR_mesh_quantization', 'KHR_materials_unlit'];

/** Bytes of a number by `componentType`. */
const COMPONENT_BYTES: Readonly<Record<number, number>> = { 5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4 };
export const I8 = 5120;
export const U8 = 5121;
export const I16 = 5122;
export const U16 = 5123;
export const F32 = 5126;

const WIDTHS: Readonly<Record<string, number>> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

/** Where an array lies in the binary chunk. */
export interface Accessor {
  readonly component: number;
  readonly normalised: boolean;
  /** Numbers of an element. */
  readonly width: number;
  /** Elements. */
  readonly count: number;
  /** Of the first element in the binary chunk, and bytes from one to the next. */
  readonly offset: number;
  readonly stride: number;
}

/** The JSON of a `.glb`, whose look-ups are checked. */
export class Document {
  /** `binBytes`: bytes of the binary chunk. */
  constructor(
    readonly root: Json,
    private readonly binBytes: number,
  ) {
    const asset = objectOf(root.asset, 'asset');
    const version = asset.minVersion ?? asset.version;
    if (version !== '2.0' && !(asset.minVersion === undefined && /^2\./.test(String(version)))) {
      throw unsupported(`glTF of version ${quoted(version)}, supported: 2.0`);
    }
    for (const name of this.list('extensionsRequired')) {
      if (!UNDERSTOOD.includes(name as string)) throw unsupported(`the file requires the extension ${quoted(name)}`);
    }
  }

  /** A list of the root; empty if it is absent. */
  list(name: string): readonly unknown[] {
    return this.root[name] === undefined ? [] : listOf(this.root[name], name);
  }

  /** An object of a list of the root. */
  at(name: string, index: unknown, user: string): Json {
    const list = this.list(name);
    const place = wholeOf(index, user);
    if (place >= list.length) throw invalid(`${user}: ${name} ${place} of ${list.length}`);
    return objectOf(list[place], `${name}[${place}]`);
  }

  /** Where a buffer view lies in the binary chunk. */
  view(index: unknown, user: string): { readonly offset: number; readonly bytes: number; readonly stride: number | undefined } {
    const view = this.at('bufferViews', index, user);
    const buffer = this.at('buffers', view.buffer, user);
    if (buffer.uri !== undefined) throw unsupported(`${user}: a buffer in another file; pack all into one .glb file`);
    if (view.buffer !== 0) throw invalid(`${user}: buffer ${quoted(view.buffer)} has no bytes`);
    const declared = wholeOf(buffer.byteLength, `${user}: byteLength`);
    if (declared > this.binBytes) throw invalid(`a buffer of ${declared} bytes, found ${this.binBytes}: data are missing`);
    const offset = wholeOf(view.byteOffset ?? 0, `${user}: byteOffset`);
    const bytes = wholeOf(view.byteLength, `${user}: byteLength`);
    if (offset + bytes > declared) throw invalid(`${user}: ${bytes} bytes from byte ${offset} of a buffer of ${declared}`);
    return { offset, bytes, stride: view.byteStride === undefined ? undefined : wholeOf(view.byteStride, `${user}: byteStride`) };
  }

  /** Where the elements of an accessor lie. */
  accessor(index: unknown, user: string): Accessor {
    const accessor = this.at('accessors', index, user);
    if (accessor.sparse !== undefined || accessor.bufferView === undefined) throw unsupported(`${user}: an accessor that is sparse or without bufferView`);
    const view = this.view(accessor.bufferView, user);
    const component = wholeOf(accessor.componentType, `${user}: componentType`);
    const size = COMPONENT_BYTES[component];
    const width = WIDTHS[textOf(accessor.type, `${user}: type`)];
    if (size === undefined || width === undefined) throw invalid(`${user}: unknown type ${component} ${quoted(accessor.type)}`);
    const count = wholeOf(accessor.count, `${user}: count`, 2 ** 24);
    const stride = view.stride ?? size * width;
    if (count < 1 || stride < size * width || stride > Math.max(252, size * width)) throw invalid(`${user}: ${count} elements at a stride of ${stride} bytes`);
    const offset = wholeOf(accessor.byteOffset ?? 0, `${user}: byteOffset`);
    const needed = offset + stride * (count - 1) + size * width;
    if (needed > view.bytes) throw invalid(`${user}: ${needed} bytes, its view has ${view.bytes}: data are missing`);
    return { component, normalised: accessor.normalized === true, width, count, offset: view.offset + offset, stride };
  }
}

/** What stands for 1 in normalised integers. */
const ONES: Readonly<Record<number, number>> = { [I8]: 127, [U8]: 255, [I16]: 32767, [U16]: 65535 };

/** The first `width` numbers of each element; floats as they are, normalised integers as -1 to 1 or 0 to 1. */
export function numbersAt(bin: Uint8Array, accessor: Accessor, width = accessor.width): Float32Array {
  const { component, normalised, count, offset, stride } = accessor;
  const view = viewOf(bin);
  const size = COMPONENT_BYTES[component];
  const out = new Float32Array(count * width);
  const one = normalised ? (ONES[component] ?? 1) : 1;
  const read = {
    [I8]: (at: number) => view.getInt8(at),
    [U8]: (at: number) => view.getUint8(at),
    [I16]: (at: number) => view.getInt16(at, true),
    [U16]: (at: number) => view.getUint16(at, true),
    5125: (at: number) => view.getUint32(at, true),
    [F32]: (at: number) => view.getFloat32(at, true),
  }[component]!;
  for (let i = 0, to = 0; i < count; i += 1) {
    for (let k = 0, at = offset + stride * i; k < width; k += 1, at += size, to += 1) {
      const value = read(at);
      out[to] = one === 1 ? value : Math.max(value / one, -1);
    }
  }
  return out;
}
