import type { SceneInfo } from '../../scene';
import { check } from '../errors';
import { choiceOf, parseJson, textOf } from '../json';
import { readMeta } from '../meta';
import { unpacked } from '../zstd';
import words from '../../../../../exporters/schema/ltgs-words.txt?raw';
import type { ChunkDecoder } from './chunk';
import type { Header } from './header';
import { lossless } from './lossless';
import { lossy } from './lossy';
import { readQuantiser } from './quantiser';

/** What the metadata of a file say (`ltgs.md`, section 1.2). */
export interface About {
    readonly info: SceneInfo;
    /** Hash of the content. */
    readonly hash: string;
    readonly decoder: ChunkDecoder;
}

/** Checks a hash as a file states it: 16 hexadecimal digits. */
export function hashOf(value: unknown): string {
    const hash = textOf(value, 'hash').toLowerCase();
    check(/^[0-9a-f]{16}$/.test(hash), 'hash', hash, '16 hexadecimal digits');
    return hash;
}

export function readAbout(coded: Uint8Array, header: Header): About {
    const { quality, isLossless, splats, texels, shDegree, metaTextBytes, fileBytes } = header;
    const about = parseJson(unpacked(coded, metaTextBytes, new TextEncoder().encode(words)), 'metadata');
    choiceOf(about.quality, 'quality', [quality]);
    choiceOf(about.order, 'order', [isLossless ? 'given' : 'morton']);
    return {
        info: {
            container: 'ltgs', quality, splats, texels, shDegree, ...readMeta(about.meta), untextured: null, fileBytes,
        },
        hash: hashOf(about.hash),
        decoder: isLossless ? lossless(shDegree) : lossy(shDegree, readQuantiser(about.quantiser)),
    };
}
