import { readScene, SceneSplats } from '../../src/core/read';
import { contentHash } from '../../src/core/read/hash';
import { ENTRY_BYTES, HEADER_BYTES, readEntries, readHeader } from '../../src/core/read/ltgs/header';
import { unpacked } from '../../src/core/read/zstd';
import { file, seal } from './scenes';

/** Bytes as a frame of zstd that stores them as they are: fewer than 128 KiB. */
function framed(bytes: Uint8Array): Uint8Array {
    const frame = new Uint8Array(12 + bytes.length);
    const view = new DataView(frame.buffer);
    view.setUint32(0, 0xfd2fb528, true);
    frame[4] = 0xa0; // one segment, its size in four bytes
    view.setUint32(5, bytes.length, true);
    view.setUint32(9, (bytes.length << 3) | 1, true); // the last block, stored; three bytes, as it is small
    frame.set(bytes, 12);
    return frame;
}

/** A file of many chunks from a lossy one of several: the last layer begins with `times` copies of its first chunk. */
export async function repeated(bytes: Uint8Array, times: number): Promise<Uint8Array> {
    const header = readHeader(bytes.subarray(0, HEADER_BYTES));
    const tables = HEADER_BYTES + header.metaBytes;
    const table = bytes.subarray(tables, tables + ENTRY_BYTES * header.chunks);
    const entries = readEntries(table, header);
    const text = new TextDecoder().decode(unpacked(bytes.subarray(HEADER_BYTES, tables), header.metaTextBytes, new Uint8Array(file('exporters/schema/ltgs-words.txt'))));
    const last = entries.findIndex(({ layer }) => layer === entries.at(-1)!.layer);
    const chunks = entries.flatMap((_, chunk) => Array<number>(chunk === last ? times : 1).fill(chunk));
    const inFile = (hash: string): Uint8Array => {
        const stated = new TextEncoder().encode(text.replace(/"hash":"[0-9a-f]{16}"/, `"hash":"${hash}"`));
        const meta = framed(stated);
        const places = new Uint8Array(ENTRY_BYTES * chunks.length);
        const view = new DataView(places.buffer);
        chunks.forEach((chunk, i) => places.set(table.subarray(ENTRY_BYTES * chunk, ENTRY_BYTES * (chunk + 1)), ENTRY_BYTES * i));
        const parts: Uint8Array[] = [];
        let at = HEADER_BYTES + meta.length + places.length;
        for (const layer of new Set(entries.map((entry) => entry.layer))) {
            for (const kind of [0, 1, 2]) {
                for (const [i, chunk] of chunks.entries()) {
                    if (entries[chunk].layer !== layer) continue;
                    const { offset, bytes: size } = entries[chunk].blocks[kind];
                    view.setBigUint64(ENTRY_BYTES * i + 24 * kind, BigInt(at), true);
                    parts.push(bytes.subarray(offset, offset + size));
                    at += size;
                }
            }
        }
        const out = new Uint8Array(at);
        const sum = (name: 'splats' | 'texels') => chunks.reduce((total, chunk) => total + entries[chunk][name], 0);
        out.set(bytes.subarray(0, HEADER_BYTES));
        const head = new DataView(out.buffer);
        head.setUint32(12, sum('splats'), true);
        head.setBigUint64(16, BigInt(sum('texels')), true);
        [meta.length, stated.length, chunks.length].forEach((value, i) => head.setUint32(28 + 4 * i, value, true));
        head.setBigUint64(40, BigInt(at), true);
        let end = HEADER_BYTES;
        for (const part of [meta, places, ...parts]) {
            out.set(part, end);
            end += part.length;
        }
        seal(out);
        return out;
    };
    const scene = new SceneSplats();
    const info = await readScene(inFile('0'.repeat(16)), { checkHash: false, onUpdate: (update) => scene.apply(update) });
    return inFile(contentHash([scene.splats!], info));
}
