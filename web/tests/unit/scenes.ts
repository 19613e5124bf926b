import { readFileSync } from 'node:fs';
import { type ReadOptions, SceneSplats, readScene } from '../../src/core/read';
import { xxh3 } from '../../src/core/read/xxh3';
import { SceneError, type SceneInfo, type SplatUpdate, type Splats } from '../../src/core/scene';

/** Bytes of a file of the repository, by its path from the root. */
export function file(path: string): Uint8Array {
    return new Uint8Array(readFileSync(new URL(`../../../${path}`, import.meta.url)));
}

export interface Outcome {
    info: SceneInfo | null;
    splats: Splats | null;
    updates: SplatUpdate[];
    warnings: string[];
    standIn: Splats | null;
    /** What reading rejected with. */
    error: unknown;
}

/** Reads a scene to the end or to an error. `pieceBytes`: it arrives in pieces of this many bytes. */
export async function outcomeOf(bytes: Uint8Array, options: ReadOptions = {}, pieceBytes?: number): Promise<Outcome> {
    const scene = new SceneSplats();
    const outcome: Outcome = { info: null, splats: null, updates: [], warnings: [], standIn: null, error: null };
    const source = pieceBytes === undefined ? bytes : streamOf(bytes, pieceBytes);
    await readScene(source, {
        ...options,
        onInfo: (info) => (outcome.info = info),
        onStandIn: (splats) => (outcome.standIn = splats),
        onUpdate: (update) => {
            if (update.first > (scene.splats?.count ?? 0)) throw new Error(`a gap before splat ${update.first}`);
            scene.apply(update);
            outcome.updates.push(update);
        },
        onWarning: (text) => outcome.warnings.push(text),
    }).catch((error: unknown) => (outcome.error = error));
    return { ...outcome, splats: scene.splats };
}

export function streamOf(bytes: Uint8Array, pieceBytes: number): ReadableStream<Uint8Array> {
    let at = 0;
    return new ReadableStream(
        {
            pull(controller) {
                if (at >= bytes.length) return controller.close();
                controller.enqueue(bytes.slice(at, at + pieceBytes));
                at += pieceBytes;
            },
        },
        { highWaterMark: 0 },
    );
}

/** The message of an error that a reader may reject with; anything else is a fault. */
export function messageOf(error: unknown): string {
    if (!(error instanceof SceneError)) throw new Error('not a SceneError', { cause: error });
    return `${error.kind}: ${error.message}`;
}

/** JSON and binary chunk of a `.glb`. */
export function split(glb: Uint8Array): { json: any; bin: Uint8Array } {
    const end = 20 + new DataView(glb.buffer, glb.byteOffset).getUint32(12, true);
    return { json: JSON.parse(new TextDecoder().decode(glb.subarray(20, end))), bin: glb.subarray(end + 8) };
}

export function join(json: unknown, bin: Uint8Array): Uint8Array {
    const text = new TextEncoder().encode(JSON.stringify(json));
    const padded = Math.ceil(text.length / 4) * 4;
    const out = new Uint8Array(28 + padded + bin.length).fill(32, 20, 20 + padded);
    const view = new DataView(out.buffer);
    const numbers = [0x46546c67, 2, out.length, padded, 0x4e4f534a];
    numbers.forEach((number, i) => view.setUint32(4 * i, number, true));
    out.set(text, 20);
    view.setUint32(20 + padded, bin.length, true);
    view.setUint32(24 + padded, 0x004e4942, true);
    out.set(bin, 28 + padded);
    return out;
}

/** The object of our extension in the JSON of a `.glb`. */
export function ours(json: any): any {
    return json.meshes[0].primitives[0].extensions.KHR_gaussian_splatting.extensions.LITETEX_gaussian_splatting_texture;
}

/** Makes the checksums of a `.ltgs` file right again, as far as its tables reach, so that damage gets past them. */
export function seal(bytes: Uint8Array): void {
    if (bytes.length < 64) return;
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const put = (at: number, of: Uint8Array): void => view.setBigUint64(at, BigInt(`0x${xxh3(of)}`), true);
    const number = (at: number): number => Number(view.getBigUint64(at, true));
    const first = 64 + view.getUint32(28, true);
    const end = first + 112 * view.getUint32(36, true);
    for (let entry = first; entry + 112 <= Math.min(end, bytes.length); entry += 112) {
        for (const at of [entry, entry + 24, entry + 48]) {
            const [offset, size] = [number(at), number(at + 8)];
            if (offset + size <= bytes.length) put(at + 16, bytes.subarray(offset, offset + size));
        }
    }
    if (end <= bytes.length) put(48, bytes.subarray(64, end));
    put(56, bytes.subarray(0, 56));
}

/** Pseudo-random numbers below a bound. */
export function randomOf(seed: number): (bound: number) => number {
    let state = seed;
    return (bound) => {
        state = (state + 0x6d2b79f5) | 0;
        let z = Math.imul(state ^ (state >>> 15), state | 1);
        z ^= z + Math.imul(z ^ (z >>> 7), z | 61);
        return (((z ^ (z >>> 14)) >>> 0) % Math.max(bound, 1));
    };
}
