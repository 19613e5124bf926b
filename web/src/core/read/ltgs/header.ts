import { hex64, u64At, viewOf } from '../bytes';
import { check, support } from '../errors';
import { xxh3 } from '../xxh3';

export const HEADER_BYTES = 64;
export const ENTRY_BYTES = 112;

/** Splats of every chunk but the last of its layer. */
const CHUNK_SPLATS = 4096;

const QUALITIES = ['lossless', 'balanced', 'tiny', 'custom'];

/** The header of a file (`ltgs.md`, section 1.1). */
export interface Header {
    readonly splats: number;
    readonly texels: number;
    readonly shDegree: number;
    readonly quality: string;
    readonly isLossless: boolean;
    readonly metaBytes: number;
    readonly metaTextBytes: number;
    readonly chunks: number;
    readonly fileBytes: number;
    /** Hash of metadata and table of contents. */
    readonly tablesHash: string;
}

/** Checks bytes by their xxh3-64. */
export function checkHash(bytes: Uint8Array, expected: string, what: string): void {
    const found = xxh3(bytes);
    check(found === expected, `checksum of ${what}`, found, expected);
}

/** Reads and checks the first 64 bytes. */
export function readHeader(bytes: Uint8Array): Header {
    const view = viewOf(bytes);
    const u32 = (at: number): number => view.getUint32(at, true);
    const major = view.getUint16(4, true);
    support(major === 3, 'version of .ltgs', major, 3);
    checkHash(bytes.subarray(0, 56), hex64(view.getBigUint64(56, true)), 'the header');
    support(u32(8) === 0, 'feature bits', u32(8), 0);
    support(bytes[25] < QUALITIES.length, 'profile', bytes[25], '0 to 3');
    const header = {
        splats: u32(12),
        texels: u64At(view, 16),
        shDegree: bytes[24],
        quality: QUALITIES[bytes[25]],
        isLossless: bytes[25] === 0,
        metaBytes: u32(28),
        metaTextBytes: u32(32),
        chunks: u32(36),
        fileBytes: u64At(view, 40),
        tablesHash: hex64(view.getBigUint64(48, true)),
    };
    const { splats, chunks } = header;
    const most = { splats: 2 ** 24, texels: 2 ** 32 - 1, shDegree: 3, metaTextBytes: 2 ** 24, chunks: splats, fileBytes: 2 ** 53 };
    for (const [name, bound] of Object.entries(most)) {
        const found = header[name as keyof typeof most];
        check(found <= bound, `${name} of the header`, found, `at most ${bound}`);
    }
    const fewest = Math.ceil(splats / CHUNK_SPLATS);
    check(chunks >= fewest, 'chunks of the header', chunks, `at least ${fewest}`);
    const tables = HEADER_BYTES + header.metaBytes + ENTRY_BYTES * chunks;
    check(tables <= header.fileBytes, 'bytes of the file', header.fileBytes, `at least ${tables}`);
    return header;
}

/** A part of the file with a checksum. */
export interface BlockPlace {
    readonly offset: number;
    readonly bytes: number;
    readonly hash: string;
}

/** An entry of the table of contents (section 1.3). */
export interface Entry {
    /** Geometry, other SH, texels. */
    readonly blocks: readonly BlockPlace[];
    readonly texels: number;
    readonly splats: number;
    readonly layer: number;
}

/** Reads and checks the table of contents. */
export function readEntries(bytes: Uint8Array, header: Header): Entry[] {
    const view = viewOf(bytes);
    const entries = Array.from({ length: header.chunks }, (_, chunk): Entry => {
        const first = ENTRY_BYTES * chunk;
        const blocks = [0, 1, 2].map((kind): BlockPlace => {
            const at = first + 24 * kind;
            return { offset: u64At(view, at), bytes: u64At(view, at + 8), hash: hex64(view.getBigUint64(at + 16, true)) };
        });
        const [splats, layer] = [80, 84].map((at) => view.getUint32(first + at, true));
        return { blocks, texels: u64At(view, first + 72), splats, layer };
    });
    entries.forEach(({ layer, splats }, chunk) => {
        const before = chunk > 0 ? entries[chunk - 1].layer : 0;
        const most = chunk > 0 && !header.isLossless ? before + 1 : before;
        check(layer >= before && layer <= most, `layer of chunk ${chunk}`, layer, `${before} to ${most}`);
        const fewest = entries[chunk + 1]?.layer === layer ? CHUNK_SPLATS : 1;
        check(splats >= fewest && splats <= CHUNK_SPLATS, `splats of chunk ${chunk}`, splats, `${fewest} to ${CHUNK_SPLATS}`);
    });
    let end = HEADER_BYTES + header.metaBytes + bytes.length;
    // In the order of the file (section 1).
    const inOrder = layersOf(entries).flatMap((layer) => [0, 1, 2].flatMap((kind) => layer.map(({ blocks }) => blocks[kind])));
    for (const { offset, bytes: size } of inOrder) {
        const most = header.fileBytes - size;
        check(offset >= end && offset <= most, 'place of a block', offset, `${end} to ${most}`);
        end = offset + size;
    }
    for (const name of ['splats', 'texels'] as const) {
        const sum = entries.reduce((total, entry) => total + entry[name], 0);
        check(sum === header[name], `${name} of the chunks`, sum, header[name]);
    }
    return entries;
}

/** The chunks of each layer. */
export function layersOf(entries: readonly Entry[]): Entry[][] {
    const layers: Entry[][] = [];
    for (const entry of entries) (layers[entry.layer] ??= []).push(entry);
    return layers;
}
