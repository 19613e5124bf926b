import type { SceneInfo } from '../../scene';
import { check } from '../errors';
import { choiceOf, objectOf, parseJson, textOf, wholeOf } from '../json';
import { readMeta } from '../meta';
import { unpacked } from '../zstd';
import words from '../../../../../exporters/schema/ltgs-words.txt?raw';
import type { Header } from './header';
import type { Coding } from './job';
import { readQuantiser } from './quantiser';

/** What the metadata of a file say (`ltgs.md`, section 1.2). */
export interface About {
    readonly info: SceneInfo;
    /** Hash of the content. */
    readonly hash: string;
    readonly coding: Coding;
    readonly standIn: StandInEntry | null;
}

/** A stand-in right behind the tables: once `untilBytes` bytes behind it have arrived, the scene itself looks better. */
export interface StandInEntry {
    readonly bytes: number;
    readonly hash: string;
    readonly untilBytes: number;
}

/** Checks a hash as a file states it: 16 hexadecimal digits. */
export function hashOf(value: unknown): string {
    const hash = textOf(value, 'hash').toLowerCase();
    check(/^[0-9a-f]{16}$/.test(hash), 'hash', hash, '16 hexadecimal digits');
    return hash;
}

function standInOf(value: unknown): StandInEntry {
    const { bytes, hash, untilBytes } = objectOf(value, 'standIn');
    return { bytes: wholeOf(bytes, 'standIn.bytes'), hash: hashOf(hash), untilBytes: wholeOf(untilBytes, 'standIn.untilBytes') };
}

export function readAbout(coded: Uint8Array, header: Header): About {
    const { quality, isLossless, splats, texels, shDegree, metaTextBytes, fileBytes } = header;
    const about = parseJson(unpacked(coded, metaTextBytes, new TextEncoder().encode(words)), 'metadata');
    choiceOf(about.quality, 'quality', [quality]);
    choiceOf(about.order, 'order', [isLossless ? 'given' : 'morton']);
    return {
        info: {
            container: 'ltgs', quality, splats, texels, shDegree, ...readMeta(about.meta), untextured: null, standInUntil: null, fileBytes,
        },
        hash: hashOf(about.hash),
        standIn: about.standIn === undefined ? null : standInOf(about.standIn),
        coding: { shDegree, quantiser: isLossless ? null : readQuantiser(about.quantiser) },
    };
}
