import type { SceneInfo, Splats } from '../../scene';
import { viewOf } from '../bytes';
import { checkSplats } from '../check';
import { check, support } from '../errors';
import { contentHash } from '../hash';
import { type Json, objectOf, parseJson, textOf } from '../json';
import { checkMemory } from '../limits';
import { hashOf } from '../ltgs/about';
import { readLtgs } from '../ltgs/read';
import type { ReadOptions } from '../options';
import type { Source } from '../source';
import { firstOf, shWidth } from '../splats';
import { firstOnes, readAttributes } from './attributes';
import { Document, F32, U8 } from './document';
import { ownNumbers, withMaps } from './maps';
import { type Found, findScene, metaOf } from './scene';

/** Bytes of the file's header and of that of the first chunk. */
const HEADER_BYTES = 20;
const CHUNK_HEADER_BYTES = 8;
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

/** Most bytes of JSON: 16 MiB of metadata, and room for the rest. */
const JSON_BYTES_MAX = 17 * 2 ** 20;

const MIME_LTGS = 'application/vnd.litetex.ltgs';

/** Reads a `.glb` file of splats (`exporters/schema/gltf.md`); an embedded `.ltgs` file while it arrives. */
export async function readGlb(source: Source, options: ReadOptions): Promise<SceneInfo> {
    const head = viewOf(await source.take(HEADER_BYTES));
    const [version, fileBytes, jsonBytes, kind] = [4, 8, 12, 16].map((at) => head.getUint32(at, true));
    support(version === 2, 'version of GLB', version, 2);
    check(kind === JSON_CHUNK, 'first chunk', kind, 'JSON');
    support(jsonBytes <= JSON_BYTES_MAX, 'bytes of JSON', jsonBytes, `at most ${JSON_BYTES_MAX}`);
    const json = parseJson(await source.take(jsonBytes), 'JSON of the file');
    let binBytes = 0;
    if (source.taken + CHUNK_HEADER_BYTES <= fileBytes) {
        const chunk = viewOf(await source.take(CHUNK_HEADER_BYTES));
        if (chunk.getUint32(4, true) === BIN_CHUNK) binBytes = chunk.getUint32(0, true);
    }
    check(source.taken + binBytes <= fileBytes, 'bytes of the file', fileBytes, `at least ${source.taken + binBytes}`);
    const document = new Document(json, binBytes);
    const found = findScene(document);
    const info =
        found.ours?.stream === undefined
            ? await readArrays(source, document, found, binBytes, fileBytes, options)
            : await readStream(source, document, found, found.ours, fileBytes, options);
    check(source.arrived <= fileBytes, 'bytes of the file', source.arrived, fileBytes);
    return info;
}

/** Reads an embedded file (section 3a). */
async function readStream(
    source: Source,
    document: Document,
    { attributes, worldFromData, colourSpace }: Found,
    ours: Json,
    fileBytes: number,
    options: ReadOptions,
): Promise<SceneInfo> {
    for (const name of ['rects', 'pages', 'texelSize', 'shift', 'shDegree', 'sh0', 'atlas', 'decode', 'meta']) {
        check(ours[name] === undefined, 'beside stream', name, 'nothing');
    }
    const { bufferView, mimeType } = objectOf(ours.stream, 'stream');
    support(mimeType === MIME_LTGS, 'type of the stream', mimeType, MIME_LTGS);
    const { offset, bytes } = document.view(bufferView, 'stream');
    await source.skipTo(source.taken + offset);
    return readLtgs(source, options, bytes, (info, hash) => {
        check(info.splats === attributes.count, 'splats of the stream', info.splats, attributes.count);
        check(info.quality === ours.quality, 'quality of the stream', info.quality, ours.quality);
        check(hash === hashOf(ours.hash), 'hash of the stream', hash, ours.hash);
        check(info.colourSpace === colourSpace, 'colour space of the stream', info.colourSpace, colourSpace);
        return { ...info, container: 'gltf', worldFromData: worldFromData ?? info.worldFromData, fileBytes };
    });
}

/** Reads splats from attributes and arrays: first without textures and view-dependent colours, if all others are still to come. */
async function readArrays(
    source: Source,
    document: Document,
    found: Found,
    binBytes: number,
    fileBytes: number,
    { onInfo, onUpdate, onWarning, maxSplats = Infinity, checkHash, fileBytes: knownBytes = Infinity }: ReadOptions,
): Promise<SceneInfo> {
    const { attributes, ours, isOurs, untextured, texels: toCome } = found;
    const { count, degree } = attributes;
    const meta = metaOf(document, found);
    const quality = ours ? textOf(ours.quality, 'quality') : '';
    const hash = ours ? hashOf(ours.hash) : '';
    const checkTexels = (texels: number): void => checkMemory(count, texels, degree, Math.min(fileBytes, knownBytes));
    const begin = (texels: number): SceneInfo => {
        const info: SceneInfo = {
            container: 'gltf', quality, splats: count, texels, shDegree: degree, ...meta, untextured, standInUntil: null, fileBytes,
        };
        onInfo?.(info);
        return info;
    };
    const show = (splats: Splats, bytes: number, complete: boolean): void => {
        onUpdate?.({ first: 0, splats: firstOf(splats, maxSplats), bytes, complete });
    };
    let info: SceneInfo | null = null;
    const first = firstOnes(attributes);
    if (toCome !== null && first.end < binBytes) {
        const there = await source.peek(first.end);
        if (there.length === first.end && source.arrived < source.taken + binBytes) {
            checkTexels(toCome);
            const splats = readAttributes(there, first.attributes, isOurs);
            checkSplats(splats);
            info = begin(toCome);
            show(splats, source.taken + first.end, false);
        }
    }
    const bin = await source.take(binBytes);
    checkTexels(0);
    let splats = readAttributes(bin, attributes, isOurs);
    if (ours) splats = await withMaps(document, bin, ours, withOwnSh(document, bin, ours, splats, degree), checkTexels);
    checkSplats(splats);
    const texels = splats.texels.length / 3;
    check(toCome === null || texels === toCome, 'texels of the digest', toCome, texels);
    info ??= begin(texels);
    show(splats, source.taken, true);
    if (ours && checkHash !== false && contentHash([splats], meta) !== hash) {
        onWarning?.('the content does not match its hash: a program has changed values');
    }
    return info;
}

/** Splats with exact SH of degree 0, and each of its own degree. */
function withOwnSh(document: Document, bin: Uint8Array, ours: Json, splats: Splats, degree: number): Splats {
    const { count } = splats;
    const width = shWidth(degree);
    if (ours.sh0 !== undefined) {
        const exact = ownNumbers(document, bin, ours, 'sh0', count, 3, [F32]);
        for (let i = 0; i < 3 * count; i += 1) {
            const at = width * Math.floor(i / 3) + (i % 3);
            // Those for other viewers, too.
            if (!Number.isFinite(splats.sh[at])) check(false, 'SH of degree 0 for other viewers', splats.sh[at], 'finite numbers');
            splats.sh[at] = exact[i];
        }
    }
    if (ours.shDegree === undefined) return splats;
    const shDegrees = Uint8Array.from(ownNumbers(document, bin, ours, 'shDegree', count, 1, [U8]));
    const most = shDegrees.reduce((a, b) => Math.max(a, b), 0);
    check(most === degree, 'largest SH degree', most, degree);
    const sh = new Float32Array(shDegrees.reduce((sum, own) => sum + shWidth(own), 0));
    let at = 0;
    shDegrees.forEach((own, i) => {
        const all = splats.sh.subarray(width * i, width * (i + 1));
        sh.set(all.subarray(0, shWidth(own)), at);
        at += shWidth(own);
        check(all.subarray(shWidth(own)).every((c) => c === 0), 'SH coefficients above the degree of a splat', 'some', 0);
    });
    return { ...splats, shDegrees, sh };
}
