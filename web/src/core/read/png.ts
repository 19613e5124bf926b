import { viewOf } from './bytes';
import { invalid } from './errors';

/**
 * Reads PNG images of data: RGB of 8 bits, not interlaced (`gltf.md`, section 3). Image decoders of browsers may convert
 * colours.
 */

const SIGNATURE = [137, 80, 78, 71, 13, 10, 26, 10];

/** Bytes of a pixel. */
const PIXEL = 3;

/** What deflate makes of a byte at most. */
const EXPANSION_MAX = 1040;

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, i) => {
  let c = i;
  for (let bit = 0; bit < 8; bit += 1) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

function crc32(bytes: Uint8Array): number {
  let c = 0xffffffff;
  for (let i = 0; i < bytes.length; i += 1) c = CRC_TABLE[(c ^ bytes[i]) & 255] ^ (c >>> 8);
  return ~c >>> 0;
}

/** Pixels of an image of this size, RGB, rows from the top. */
export async function readPng(bytes: Uint8Array, width: number, height: number): Promise<Uint8Array> {
  const data = imageData(bytes, width, height);
  const rowBytes = 1 + PIXEL * width;
  const coded = data.reduce((sum, part) => sum + part.length, 0);
  if (rowBytes * height > EXPANSION_MAX * coded + 4096) throw invalid(`PNG: ${coded} bytes cannot hold ${width} x ${height} pixels`);
  const rows = await inflated(data, rowBytes * height);
  return unfiltered(rows, width, height);
}

/** The parts of the compressed data, once all other chunks are as expected. */
function imageData(bytes: Uint8Array, width: number, height: number): Uint8Array<ArrayBuffer>[] {
  if (SIGNATURE.some((byte, i) => bytes[i] !== byte)) throw invalid('PNG: not a PNG image');
  const view = viewOf(bytes);
  const data: Uint8Array<ArrayBuffer>[] = [];
  for (let at = 8, isFirst = true; ; isFirst = false) {
    const size = at + 12 <= bytes.length ? view.getUint32(at) : Infinity;
    if (size > bytes.length - at - 12) throw invalid('PNG: truncated');
    const kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    const body = bytes.subarray(at + 8, at + 8 + size);
    if (crc32(bytes.subarray(at + 4, at + 8 + size)) !== view.getUint32(at + 8 + size)) throw invalid(`PNG: checksum of ${kind}: damaged`);
    if (isFirst !== (kind === 'IHDR')) throw invalid(`PNG: ${kind} where IHDR is expected`);
    if (isFirst) {
      const found = [...body].join();
      const expected = [...new Uint8Array(Uint32Array.of(width, height).buffer)];
      const header = [...expected.slice(0, 4).reverse(), ...expected.slice(4).reverse(), 8, 2, 0, 0, 0].join();
      if (found !== header) throw invalid(`PNG: header ${found}, expected ${header}: ${width} x ${height}, RGB of 8 bits, not interlaced`);
    } else if (kind === 'IDAT') {
      data.push(body as Uint8Array<ArrayBuffer>);
    } else if (kind === 'IEND') {
      return data;
    } else if ((bytes[at + 4] & 32) === 0 && kind !== 'PLTE') {
      throw invalid(`PNG: unknown chunk ${kind}`);
    }
    at += 12 + size;
  }
}

/** Inflates data that make exactly `count` bytes. */
async function inflated(data: Uint8Array<ArrayBuffer>[], count: number): Promise<Uint8Array> {
  const reader = new Blob(data).stream().pipeThrough(new DecompressionStream('deflate')).getReader();
  const out = new Uint8Array(count);
  let at = 0;
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (value.length > count - at) {
        await reader.cancel();
        at = Infinity;
        break;
      }
      out.set(value, at);
      at += value.length;
    }
  } catch {
    throw invalid('PNG: its compressed data are damaged');
  }
  if (at !== count) throw invalid(`PNG: ${at === Infinity ? 'more' : at} bytes, expected ${count}`);
  return out;
}

/** Undoes the filters of rows, each with the kind of its filter before it. */
function unfiltered(rows: Uint8Array, width: number, height: number): Uint8Array {
  const size = PIXEL * width;
  const out = new Uint8Array(size * height);
  const first = new Uint8Array(size);
  for (let y = 0; y < height; y += 1) {
    const kind = rows[y * (size + 1)];
    const from = rows.subarray(y * (size + 1) + 1, (y + 1) * (size + 1));
    const to = out.subarray(y * size, (y + 1) * size);
    const above = y === 0 ? first : out.subarray((y - 1) * size, y * size);
    unfilter(kind, from, to, above);
  }
  return out;
}

function unfilter(kind: number, from: Uint8Array, to: Uint8Array, above: Uint8Array): void {
  if (kind > 4) throw invalid(`PNG: filter ${kind}, expected 0 to 4`);
  for (let i = 0; i < from.length; i += 1) {
    const left = i < PIXEL ? 0 : to[i - PIXEL];
    const up = above[i];
    let predicted = 0;
    if (kind === 1) predicted = left;
    else if (kind === 2) predicted = up;
    else if (kind === 3) predicted = (left + up) >> 1;
    else if (kind === 4) predicted = paeth(left, up, i < PIXEL ? 0 : above[i - PIXEL]);
    to[i] = from[i] + predicted;
  }
}

function paeth(left: number, up: number, corner: number): number {
  const estimate = left + up - corner;
  const a = Math.abs(estimate - left);
  const b = Math.abs(estimate - up);
  const c = Math.abs(estimate - corner);
  return a <= b && a <= c ? left : b <= c ? up : corner;
}
