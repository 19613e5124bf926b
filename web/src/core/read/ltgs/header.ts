import { hexAt, u64At, viewOf } from '../bytes';
import { invalid, unsupported } from '../errors';
import { xxh3 } from '../xxh3';

export const HEADER_BYTES = 64;
export const ENTRY_BYTES = 112;

/** Splats of every chunk but the last of its layer. */
export const CHUNK_SPLATS = 4096;

const QUALITIES = ['lossless', 'balanced', 'tiny', 'custom'] as const;

/** The header of a file (`ltgs.md`, section 1.1). */
export interface Header {
  readonly metaIsCompressed: boolean;
  readonly splats: number;
  readonly texels: number;
  readonly shDegree: number;
  readonly quality: (typeof QUALITIES)[number];
  readonly metaBytes: number;
  readonly metaTextBytes: number;
  readonly chunks: number;
  readonly fileBytes: number;
  readonly tablesHash: string;
}

/** Reads and checks the first 64 bytes. */
export function readHeader(bytes: Uint8Array): Header {
  const view = viewOf(bytes);
  const major = view.getUint16(4, true);
  if (major !== 2) throw unsupported(`.ltgs of version ${major}, this reader knows version 2`);
  const hash = xxh3(bytes.subarray(0, 56));
  if (hash !== hexAt(view, 56)) throw invalid(`header: checksum ${hash}, stated ${hexAt(view, 56)}: damaged`);
  const flags = view.getUint32(8, true);
  if (flags > 1) throw unsupported(`header: unknown feature bits 0x${flags.toString(16)}`);
  const quality = QUALITIES[view.getUint8(25)];
  if (quality === undefined) throw unsupported(`header: unknown profile ${view.getUint8(25)}`);
  const header = {
    metaIsCompressed: flags === 1,
    splats: view.getUint32(12, true),
    texels: u64At(view, 16),
    shDegree: view.getUint8(24),
    quality,
    metaBytes: view.getUint32(28, true),
    metaTextBytes: view.getUint32(32, true),
    chunks: view.getUint32(36, true),
    fileBytes: u64At(view, 40),
    tablesHash: hexAt(view, 48),
  };
  const { splats, chunks } = header;
  const check = (name: string, found: number, most: number): void => {
    if (found > most) throw invalid(`header: ${found} ${name}, at most ${most}`);
  };
  check('splats', splats, 2 ** 24);
  check('texels', header.texels, 2 ** 32 - 1);
  check('as SH degree', header.shDegree, 3);
  check('bytes of metadata', header.metaTextBytes, 2 ** 24);
  check('bytes of the file', header.fileBytes, 2 ** 53);
  const fewest = Math.ceil(splats / CHUNK_SPLATS);
  if (chunks < fewest || chunks > splats) throw invalid(`header: ${chunks} chunks, ${splats} splats need ${fewest} to ${splats}`);
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
  /** Blocks of geometry, of the other SH, and of texels. */
  readonly blocks: readonly BlockPlace[];
  readonly texels: number;
  readonly splats: number;
  readonly layer: number;
}

/** Reads and checks the table of contents. */
export function readEntries(bytes: Uint8Array, header: Header): Entry[] {
  const view = viewOf(bytes);
  const entries = Array.from({ length: header.chunks }, (_, chunk): Entry => {
    const at = ENTRY_BYTES * chunk;
    const block = (place: number) => ({ offset: u64At(view, place), bytes: u64At(view, place + 8), hash: hexAt(view, place + 16) });
    return {
      blocks: [block(at), block(at + 24), block(at + 48)],
      texels: u64At(view, at + 72),
      splats: view.getUint32(at + 80, true),
      layer: view.getUint32(at + 84, true),
    };
  });
  checkLayers(entries, header.quality === 'lossless');
  let end = HEADER_BYTES + header.metaBytes + ENTRY_BYTES * header.chunks;
  for (const { chunk, kind } of blocksInOrder(entries)) {
    const { offset, bytes: size } = entries[chunk].blocks[kind];
    if (offset < end || size > header.fileBytes - offset) {
      throw invalid(`chunk ${chunk}: a block of ${size} bytes at ${offset}, expected within ${end} to ${header.fileBytes}`);
    }
    end = offset + size;
  }
  for (const name of ['splats', 'texels'] as const) {
    const sum = entries.reduce((total, entry) => total + entry[name], 0);
    if (sum !== header[name]) throw invalid(`table of contents: ${sum} ${name}, the header says ${header[name]}`);
  }
  return entries;
}

function checkLayers(entries: Entry[], isLossless: boolean): void {
  entries.forEach(({ layer, splats }, chunk) => {
    const before = entries[chunk - 1]?.layer;
    const most = before === undefined || isLossless ? (before ?? 0) : before + 1;
    if (layer < (before ?? 0) || layer > most) throw invalid(`chunk ${chunk}: layer ${layer}, expected ${before ?? 0} to ${most}`);
    const fewest = entries[chunk + 1]?.layer === layer ? CHUNK_SPLATS : 1;
    if (splats < fewest || splats > CHUNK_SPLATS) {
      throw invalid(`chunk ${chunk} of layer ${layer}: ${splats} splats, expected ${fewest} to ${CHUNK_SPLATS}`);
    }
  });
}

/** All blocks in the order of the file: by layer, then by kind, then by chunk (section 1). */
export function blocksInOrder(entries: readonly Entry[]): { chunk: number; kind: number }[] {
  const all: { chunk: number; kind: number }[] = [];
  for (let first = 0; first < entries.length; ) {
    let end = first + 1;
    while (entries[end]?.layer === entries[first].layer) end += 1;
    for (let kind = 0; kind < 3; kind += 1) {
      for (let chunk = first; chunk < end; chunk += 1) all.push({ chunk, kind });
    }
    first = end;
  }
  return all;
}
