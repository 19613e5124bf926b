import type { Splats } from '../../scene';
import { check, support } from '../errors';
import { type Json, listOf, numberOf, objectOf, wholeOf } from '../json';
import { SIDE_MAX } from '../ltgs/maps';
import { readPng } from '../png';
import { type Accessor, type Document, F32, I16, U16, U8, numbersAt } from './document';

/** Largest side of an atlas page. */
const PAGE_SIDE_MAX = 8192;

/** Pages may have this many texels for each that maps use, and one large page: decoding takes time for all of them. */
const PAPER_MAX = 64;
const SPARE_TEXELS = 2 ** 24;

/** An array of our extension: as many elements as splats, each of `width` numbers of one of the types. */
export function ownNumbers(
    document: Document,
    bin: Uint8Array,
    ours: Json,
    name: string,
    count: number,
    width: number,
    components: readonly number[],
): Float32Array {
    const found: Accessor = document.accessor(ours[name], name);
    const fits = found.width === width && components.includes(found.component) && !found.normalised && found.count === count;
    check(fits, name, `${found.count} x ${found.width} of ${found.component}`, `${count} x ${width} of ${components.join(' or ')}`);
    return numbersAt(bin, found);
}

/**
 * Splats with their maps (`gltf.md`, sections 1 and 3). `checkTexels` gets the number of texels before there is memory for
 * them.
 */
export async function withMaps(
    document: Document,
    bin: Uint8Array,
    ours: Json,
    splats: Splats,
    checkTexels: (texels: number) => void,
): Promise<Splats> {
    const { count } = splats;
    if (ours.rects === undefined) {
        check(ours.texelSize === undefined && ours.shift === undefined, 'rects', 'nothing', 'as many as texel sizes');
        return splats;
    }
    const own = (name: string, width: number, ...components: number[]): Float32Array =>
        ownNumbers(document, bin, ours, name, count, width, components);
    const rects = own('rects', 4, U16);
    const texelSizes = own('texelSize', 2, F32);
    const shifts = ours.shift === undefined ? splats.shifts : Int16Array.from(own('shift', 2, I16));
    const pageOf = ours.pages === undefined ? new Uint8Array(count) : own('pages', 1, U8, U16);
    const pages = listOf(ours.atlas ?? [], 'atlas').map((value) => {
        const page = objectOf(value, 'page');
        return { page, width: wholeOf(page.width, 'width', PAGE_SIDE_MAX), height: wholeOf(page.height, 'height', PAGE_SIDE_MAX) };
    });
    const [rows, cols] = [3, 2].map((place) => new Uint16Array(count).map((_, i) => rects[4 * i + place]));
    const firsts = new Uint32Array(count);
    const onPages: number[][] = pages.map(() => []);
    let used = 0;
    for (let i = 0; i < count; i += 1) {
        const [x, y] = rects.subarray(4 * i, 4 * i + 2);
        const { width = 0, height = 0 } = pages[pageOf[i]] ?? {};
        if (rows[i] * cols[i] === 0) continue;
        const isOnPage = x + cols[i] <= width && y + rows[i] <= height && Math.max(rows[i], cols[i]) <= SIDE_MAX;
        check(isOnPage, 'map', [x, y, cols[i], rows[i]].join(), `on a page of ${width} x ${height}`);
        onPages[pageOf[i]].push(i);
        firsts[i] = 3 * used;
        used += rows[i] * cols[i];
    }
    const paper = pages.reduce((sum, { width, height }) => sum + width * height, 0);
    check(used <= paper, 'texels of maps', used, `at most the ${paper} of pages`);
    support(paper <= PAPER_MAX * used + SPARE_TEXELS, `texels of pages for ${used} of maps`, paper, 'fewer');
    checkTexels(used);
    const texels = new Float32Array(3 * used);
    for (const [place, { page, width, height }] of pages.entries()) {
        if (onPages[place].length === 0) continue;
        const copy = await readPage(document, bin, ours, page, width, height);
        for (const i of onPages[place]) {
            const [x, y] = rects.subarray(4 * i, 4 * i + 2);
            for (let row = 0; row < rows[i]; row += 1) {
                const to = firsts[i] + 3 * row * cols[i];
                copy(3 * ((y + row) * width + x), texels.subarray(to, to + 3 * cols[i]));
            }
        }
    }
    return { ...splats, rows, cols, texelSizes, shifts, texels };
}

/** Copies numbers of a page from one on. */
type Copy = (from: number, to: Float32Array) => void;

async function readPage(document: Document, bin: Uint8Array, ours: Json, page: Json, width: number, height: number): Promise<Copy> {
    const { bufferView, texture } = page;
    support(page.uri === undefined, 'page', 'in another file', 'all in one .glb file');
    check((bufferView === undefined) !== (texture === undefined), 'page', 'none or two of both', 'bufferView or texture');
    const bytesOf = (view: unknown): Uint8Array => {
        const { offset, bytes } = document.view(view, 'page');
        return bin.slice(offset, offset + bytes);
    };
    if (bufferView !== undefined) {
        const bytes = bytesOf(bufferView);
        check(bytes.length === 12 * width * height, 'bytes of a page', bytes.length, 12 * width * height);
        const numbers = new Float32Array(bytes.buffer);
        return (from, to) => to.set(numbers.subarray(from, from + to.length));
    }
    const decode = objectOf(ours.decode, 'decode');
    const scale = numberOf(decode.scale, 'scale', Number.MIN_VALUE);
    const bias = numberOf(decode.bias, 'bias');
    const table = new Float32Array(256).map((_, code) => Math.max(-1, Math.min(1, Math.fround(code * scale + bias))));
    const image = document.at('images', document.at('textures', texture, 'texture').source, 'image');
    support(image.uri === undefined && (image.mimeType ?? 'image/png') === 'image/png', 'image', image.mimeType, 'PNG in one .glb file');
    const codes = await readPng(bytesOf(image.bufferView), width, height);
    return (from, to) => to.forEach((_, k) => (to[k] = table[codes[from + k]]));
}
