import { invalid, unsupported } from '../errors';
import { type Json, listOf, numberOf, objectOf, wholeOf } from '../json';
import { SIDE_MAX } from '../ltgs/maps';
import { readPng } from '../png';
import { type Accessor, type Document, F32, I16, U16, U8, numbersAt } from './document';

/** Largest side of an atlas page. */
const PAGE_SIDE_MAX = 8192;

/** Pages may have this many texels for each that maps use, and one large page: decoding takes time for all of them. */
const PAPER_MAX = 64;
const SPARE_TEXELS = 2 ** 24;

/** Where maps lie (`gltf.md`, sections 1 and 3). */
export interface MapPlaces {
  readonly rects: Accessor;
  readonly texelSize: Accessor;
  readonly shift: Accessor | null;
  readonly pages: Accessor | null;
  readonly atlas: readonly Json[];
}

/** An array of our extension: as many elements as splats, each of `width` numbers of one of the types. */
export function ownArray(document: Document, index: unknown, name: string, width: number, components: readonly number[], count: number): Accessor {
  const found = document.accessor(index, name);
  if (found.width !== width || !components.includes(found.component) || found.normalised || found.count !== count) {
    throw invalid(`${name}: ${found.count} elements of ${found.width} numbers of type ${found.component}, expected ${count} of ${width}, type ${components.join(' or ')}`);
  }
  return found;
}

/** Finds the maps of `count` splats; null if none has one. */
export function findMaps(document: Document, ours: Json, count: number): MapPlaces | null {
  const { rects, texelSize, shift, pages, atlas } = ours;
  if (rects === undefined && texelSize === undefined && shift === undefined) return null;
  if (rects === undefined || texelSize === undefined) throw invalid('rects, texelSize and shift do not fit each other');
  return {
    rects: ownArray(document, rects, 'rects', 4, [U16], count),
    texelSize: ownArray(document, texelSize, 'texelSize', 2, [F32], count),
    shift: shift === undefined ? null : ownArray(document, shift, 'shift', 2, [I16], count),
    pages: pages === undefined ? null : ownArray(document, pages, 'pages', 1, [U8, U16], count),
    atlas: listOf(atlas ?? [], 'atlas').map((page) => objectOf(page, 'atlas')),
  };
}

/** Maps and texels of splats. */
export interface Maps {
  readonly rows: Uint16Array;
  readonly cols: Uint16Array;
  readonly texelSizes: Float32Array;
  readonly shifts: Int16Array;
  readonly texels: Float32Array;
}

/** Reads maps, page by page. `checkTexels` gets the number of texels before there is memory for them. */
export async function readMaps(document: Document, bin: Uint8Array, ours: Json, places: MapPlaces, checkTexels: (texels: number) => void): Promise<Maps> {
  const rects = numbersAt(bin, places.rects);
  const pageOf = places.pages === null ? null : numbersAt(bin, places.pages);
  const { count } = places.rects;
  const sizes = places.atlas.map((page) => {
    const [width, height] = ['width', 'height'].map((side) => wholeOf(page[side], `atlas: ${side}`, PAGE_SIDE_MAX));
    return { width, height };
  });
  const onPage: number[][] = sizes.map(() => []);
  const firsts = new Uint32Array(count);
  let used = 0;
  for (let i = 0; i < count; i += 1) {
    const [x, y, cols, rows] = rects.subarray(4 * i, 4 * i + 4);
    if (rows === 0 && cols === 0) continue;
    const page = pageOf === null ? 0 : pageOf[i];
    const size = sizes[page];
    if (size === undefined || x + cols > size.width || y + rows > size.height || rows > SIDE_MAX || cols > SIDE_MAX) {
      throw invalid(`splat ${i}: a map of ${rows} rows and ${cols} columns at ${x}, ${y} does not lie on page ${page}`);
    }
    onPage[page].push(i);
    firsts[i] = used;
    used += rows * cols;
  }
  const paper = sizes.reduce((sum, { width, height }) => sum + width * height, 0);
  if (used > paper) throw invalid(`maps of ${used} texels on pages of ${paper}: they overlap`);
  if (paper > PAPER_MAX * used + SPARE_TEXELS) throw unsupported(`pages of ${paper} texels for maps of ${used}`);
  checkTexels(used);
  const texels = new Float32Array(3 * used);
  for (const [i, own] of onPage.entries()) {
    if (own.length === 0) continue;
    const { width, height } = sizes[i];
    const page = await readPage(document, bin, ours, places.atlas[i], width, height);
    for (const splat of own) {
      const [x, y, cols, rows] = rects.subarray(4 * splat, 4 * splat + 4);
      for (let row = 0; row < rows; row += 1) page(3 * ((y + row) * width + x), 3 * cols, texels, 3 * (firsts[splat] + row * cols));
    }
  }
  return {
    rows: Uint16Array.from({ length: count }, (_, i) => rects[4 * i + 3]),
    cols: Uint16Array.from({ length: count }, (_, i) => rects[4 * i + 2]),
    texelSizes: numbersAt(bin, places.texelSize),
    shifts: places.shift === null ? new Int16Array(2 * count) : Int16Array.from(numbersAt(bin, places.shift)),
    texels,
  };
}

/** Copies numbers of a page: from where, how many, and to where. */
type Copy = (from: number, count: number, texels: Float32Array, to: number) => void;

async function readPage(document: Document, bin: Uint8Array, ours: Json, page: Json, width: number, height: number): Promise<Copy> {
  const { bufferView, texture, uri } = page;
  if ([bufferView, texture, uri].filter((source) => source !== undefined).length !== 1) throw invalid('atlas: expected one of bufferView, texture and uri');
  if (uri !== undefined) throw unsupported('atlas: a page in another file; pack all into one .glb file');
  if (bufferView !== undefined) {
    const { offset, bytes } = document.view(bufferView, 'atlas');
    if (bytes !== 12 * width * height) throw invalid(`atlas: ${bytes} bytes, expected ${12 * width * height} of f32 RGB`);
    const view = new DataView(bin.buffer, bin.byteOffset + offset, bytes);
    return (from, count, texels, to) => {
      for (let k = 0; k < count; k += 1) texels[to + k] = view.getFloat32(4 * (from + k), true);
    };
  }
  const decode = objectOf(ours.decode, 'decode');
  const [scale, bias] = [numberOf(decode.scale, 'decode.scale'), numberOf(decode.bias, 'decode.bias')];
  if (!(scale > 0)) throw invalid(`decode.scale: found ${scale}, expected a positive number`);
  const table = Float32Array.from({ length: 256 }, (_, code) => Math.max(-1, Math.min(1, Math.fround(code * scale + bias))));
  const image = document.at('images', document.at('textures', texture, 'atlas').source, 'atlas');
  if (image.uri !== undefined) throw unsupported('atlas: an image in another file; pack all into one .glb file');
  if (image.mimeType !== undefined && image.mimeType !== 'image/png') throw unsupported('atlas: an image that is no PNG');
  const { offset, bytes } = document.view(image.bufferView, 'atlas');
  const codes = await readPng(bin.subarray(offset, offset + bytes), width, height);
  return (from, count, texels, to) => {
    for (let k = 0; k < count; k += 1) texels[to + k] = table[codes[from + k]];
  };
}
