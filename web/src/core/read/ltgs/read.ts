import type { SceneInfo, Splats } from '../../scene';
import { check } from '../errors';
import { contentHash } from '../hash';
import { checkMemory } from '../limits';
import type { HelpedOptions } from '../options';
import { openSource, type Source } from '../source';
import { SceneSplats } from '../splats';
import { readAbout, type StandInEntry } from './about';
import { ENTRY_BYTES, type Entry, HEADER_BYTES, checkHash, layersOf, readEntries, readHeader } from './header';
import { type Coding, type Part, basisOf, decoded } from './job';
import { Layer } from './layer';
import { Queue } from './queue';

/**
 * Reads a `.ltgs` file (`exporters/schema/ltgs.md`) while it arrives. What has arrived before an error is shown. `room`: bytes of
 * an embedded file. `adapt` gets what the file says of itself, and the hash of its content, and may change it.
 */
export async function readLtgs(
    source: Source,
    options: HelpedOptions,
    room = Infinity,
    adapt = (info: SceneInfo, _hash: string): SceneInfo => info,
): Promise<SceneInfo> {
    const start = source.taken;
    const header = readHeader(await source.take(HEADER_BYTES));
    const isEmbedded = room < Infinity;
    check(!isEmbedded || header.fileBytes === room, 'bytes of the embedded file', header.fileBytes, room);
    const tables = await source.take(header.metaBytes + ENTRY_BYTES * header.chunks);
    checkHash(tables, header.tablesHash, 'metadata and table of contents');
    const entries = readEntries(tables.subarray(header.metaBytes), header);
    const about = readAbout(tables.subarray(0, header.metaBytes), header);
    const { standIn } = about;
    const standInEnd = source.taken - start + (standIn?.bytes ?? 0);
    const blocksStart = entries[0]?.blocks[0].offset ?? header.fileBytes;
    check(blocksStart >= standInEnd, 'place of the first block', blocksStart, `at least ${standInEnd}`);
    const standInUntil = standIn && start + standInEnd + standIn.untilBytes;
    const info = adapt({ ...about.info, standInUntil }, about.hash);
    options.onInfo?.(info);
    if (standIn && options.onStandIn) {
        const file = await source.take(standIn.bytes);
        // The scene does not depend on it.
        await readStandIn(file, standIn).then(options.onStandIn, (error: Error) => options.onWarning?.(`the stand-in is left out: ${error.message}`));
    }

    const { maxSplats = Infinity, fileBytes = Infinity } = options;
    const wanted = firstEntries(entries, maxSplats);
    const sum = (of: (entry: Entry) => number): number => wanted.reduce((total, entry) => total + of(entry), 0);
    const splats = sum((entry) => entry.splats);
    checkMemory(splats, sum((entry) => entry.texels), header.shDegree, Math.min(header.fileBytes, fileBytes));
    const parts = await readLayers(source, start, wanted, about.coding, options);
    check(isEmbedded || source.arrived <= header.fileBytes, 'bytes of the file', source.arrived, header.fileBytes);
    if (options.checkHash !== false && splats === header.splats && splats <= maxSplats) {
        const hasDegree = header.shDegree === 0 || parts.some(({ shDegrees }) => shDegrees.includes(header.shDegree));
        check(hasDegree, 'largest SH degree of a splat', 'less', header.shDegree);
        const hash = contentHash(parts, info);
        check(hash === about.hash, 'hash of the content', hash, about.hash);
    }
    return info;
}

/** Reads a stand-in, which is a file of its own. */
async function readStandIn(file: Uint8Array, { bytes, hash }: StandInEntry): Promise<Splats> {
    checkHash(file, hash, 'the stand-in');
    const splats = new SceneSplats();
    const info = await readLtgs(openSource(file, undefined).source, { onUpdate: (update) => splats.apply(update) }, bytes);
    check(info.standInUntil === null, 'stand-in of the stand-in', 'one', 'none');
    check(splats.splats !== null, 'splats of the stand-in', 0, 'at least 1');
    return splats.splats!;
}

/** The chunks that hold the first splats. */
function firstEntries(entries: readonly Entry[], count: number): readonly Entry[] {
    let wanted = 0;
    for (let splats = 0; wanted < entries.length && splats < count; wanted += 1) splats += entries[wanted].splats;
    return entries.slice(0, wanted);
}

/** Reads layers and gives their splats. */
async function readLayers(
    source: Source,
    start: number,
    wanted: readonly Entry[],
    coding: Coding,
    { maxSplats = Infinity, signal, onUpdate, helpers }: HelpedOptions,
): Promise<Splats[]> {
    const done: Splats[] = [];
    let splats = 0;
    let texels = 0;
    /** Bytes of the file up to the last block that is decoded, and its layer: those behind may be read and decoded meanwhile. */
    let bytes = source.taken;
    let shown: Layer | null = null;
    const queue = new Queue(() => { if (source.isWaiting) shown?.show(false); });
    source.onWait = () => { if (queue.isEmpty) shown?.show(false); };
    helpers?.call(wanted.length);
    try {
        for (const entries of layersOf(wanted)) {
            const layer = new Layer(entries.length, splats, maxSplats - splats, (update) => {
                signal?.throwIfAborted();
                onUpdate?.({ ...update, bytes });
            });
            const firsts: (Part | Promise<Part>)[] = [];
            for (const kind of coding.shDegree > 0 ? [0, 1, 2] : [0, 2]) {
                for (const [i, entry] of entries.entries()) {
                    const { offset, bytes: size, hash } = entry.blocks[kind];
                    await queue.orFailed(source.skipTo(start + offset));
                    const data = await queue.orFailed(source.take(size));
                    const { taken } = source;
                    checkHash(data, hash, 'a block');
                    if (kind === 0) splats += entry.splats;
                    if (kind === 2) texels += entry.texels;
                    checkMemory(splats, texels, coding.shDegree, source.arrived);
                    const geometry = kind > 0 ? (await queue.orFailed(Promise.resolve(firsts[i]))).geometry : null;
                    const job = { coding, data, kind, splats: entry.splats, texels: entry.texels, basis: geometry ? basisOf(geometry) : null };
                    const part = helpers?.decode(job) ?? decoded(job);
                    if (kind === 0) firsts.push(part);
                    queue.add(part, (there) => {
                        shown = layer;
                        bytes = taken;
                        layer.add(i, there);
                    });
                }
            }
            queue.add(null, () => {
                layer.show(true);
                done.push(...layer.parts);
            });
        }
        await queue.settled();
        signal?.throwIfAborted();
    } catch (error) {
        if (signal?.aborted) throw error;
        // Errors of blocks before come first.
        const first = await queue.settled().then(() => error, (earlier) => earlier);
        (shown as Layer | null)?.show(true);
        throw first;
    }
    return done;
}
