/** One primitive of a glTF file as a file of its own. */

import { EXTENSION, KHR } from '../core/read/gltf/names';

type Json = Record<string, unknown>;

/** Lists of a glTF file that splats refer to. */
export interface Root {
    readonly asset: Json;
    readonly accessors?: readonly { readonly bufferView?: number }[];
    readonly bufferViews?: readonly Json[];
    readonly textures?: readonly { readonly source?: number }[];
    readonly images?: readonly { readonly uri?: string; readonly bufferView?: number; readonly mimeType?: string }[];
}

export interface Bytes {
    /** Bytes of a buffer view. */
    view(index: number): Promise<ArrayBuffer>;
    /** Bytes of another file. */
    file(uri: string): Promise<ArrayBuffer>;
}

/**
 * Packs a primitive of splats and the buffer views and images that it refers to as one `.glb` file. Other buffer views are
 * left empty, so that all indices stay.
 */
export async function packGlb(root: Root, primitive: object, bytes: Bytes): Promise<ArrayBuffer> {
    const views = new Set<number>();
    const files = new Map<number, string>(); // by image
    const { attributes = {}, extensions } = primitive as { attributes?: Record<string, number>; extensions: Record<string, { extensions: Record<string, Json> }> };
    const ours = extensions[KHR].extensions[EXTENSION];
    const accessors = [...Object.values(attributes), ...['rects', 'texelSize', 'shift', 'shDegree', 'pages', 'sh0'].map((name) => ours[name])];
    for (const index of accessors) {
        const view = root.accessors?.[index as number]?.bufferView;
        if (view !== undefined) views.add(view);
    }
    const { stream, atlas } = ours as { stream?: { bufferView?: number }; atlas?: { bufferView?: number; texture?: number }[] };
    for (const { bufferView } of [stream ?? {}, ...(atlas ?? [])]) if (bufferView !== undefined) views.add(bufferView);
    for (const { texture } of atlas ?? []) {
        const source = texture === undefined ? undefined : root.textures?.[texture]?.source;
        const image = source === undefined ? undefined : root.images?.[source];
        if (image?.uri !== undefined) files.set(source!, image.uri);
        else if (image?.bufferView !== undefined) views.add(image.bufferView);
    }

    const parts: ArrayBuffer[] = [];
    let total = 0;
    const place = (part: ArrayBuffer): Json => {
        const at = { buffer: 0, byteOffset: total, byteLength: part.byteLength };
        parts.push(part, new ArrayBuffer(-part.byteLength & 3));
        total += part.byteLength + 3 & ~3;
        return at;
    };
    const bufferViews = (root.bufferViews ?? []).map((): Json => ({ buffer: 0, byteLength: 0 }));
    for (const index of views) {
        const { byteStride } = root.bufferViews![index];
        bufferViews[index] = { ...place(await bytes.view(index)), ...(byteStride === undefined ? {} : { byteStride }) };
    }
    const images = [...(root.images ?? [])];
    for (const [index, uri] of files) {
        images[index] = { mimeType: 'image/png', bufferView: bufferViews.push(place(await bytes.file(uri))) - 1 };
    }
    const json = {
        asset: root.asset, accessors: root.accessors, textures: root.textures, images, bufferViews, buffers: [{ byteLength: total }],
        meshes: [{ primitives: [primitive] }],
    };
    return join(new TextEncoder().encode(JSON.stringify(json)), parts, total);
}

function join(json: Uint8Array, parts: readonly ArrayBuffer[], total: number): ArrayBuffer {
    const jsonBytes = json.length + 3 & ~3;
    const file = new Uint8Array(28 + jsonBytes + total);
    const view = new DataView(file.buffer);
    [0x46546c67, 2, file.length, jsonBytes, 0x4e4f534a].forEach((word, i) => view.setUint32(4 * i, word, true));
    file.fill(0x20, 20, 20 + jsonBytes);
    file.set(json, 20);
    [total, 0x004e4942].forEach((word, i) => view.setUint32(20 + jsonBytes + 4 * i, word, true));
    let at = 28 + jsonBytes;
    for (const part of parts) {
        file.set(new Uint8Array(part), at);
        at += part.byteLength;
    }
    return file.buffer;
}
