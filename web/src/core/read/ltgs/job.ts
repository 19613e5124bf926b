import { check } from '../errors';
import type { Basis, Geometry, Sh, Texels } from './chunk';
import { lossless } from './lossless';
import { lossy } from './lossy';
import type { Quantiser } from './quantiser';
import { Block } from './streams';

/** How a file is coded. */
export interface Coding {
    readonly shDegree: number;
    /** Null in lossless files. */
    readonly quantiser: Quantiser | null;
}

/** A block to be decoded, with all that this takes: it can be posted. */
export interface Job {
    readonly coding: Coding;
    readonly data: Uint8Array;
    /** 0 to 2: geometry, SH, texels. */
    readonly kind: number;
    /** Splats and texels of its chunk. */
    readonly splats: number;
    readonly texels: number;
    /** Of its chunk; null for the geometry itself. */
    readonly basis: Basis | null;
}

/** A decoded block. */
export interface Part {
    readonly geometry?: Geometry;
    readonly sh?: Sh;
    readonly texels?: Texels;
}

/** Other workers, which can decode blocks. */
export interface Helpers {
    /** Called before the first block, with the number of chunks that will be read. */
    call(chunks: number): void;
    /** Null if the block had better be decoded here: there are no helpers, or all have enough to do. */
    decode(job: Job): Promise<Part> | null;
}

export function decoded({ coding: { shDegree, quantiser }, data, kind, splats, texels, basis }: Job): Part {
    const decoder = quantiser ? lossy(shDegree, quantiser) : lossless(shDegree);
    const block = new Block(data);
    const part: Part = kind === 0 ? { geometry: decoder.geometry(block, splats) } : kind === 1 ? { sh: decoder.sh(block, basis!) } : { texels: decoder.texels(block, basis!) };
    if (part.geometry) check(part.geometry.texelCount === texels, 'texels of the maps of a chunk', part.geometry.texelCount, texels);
    block.end();
    return part;
}

/** What the other blocks of a chunk depend on: the rest is long to post. */
export function basisOf({ positions: _p, rotations: _r, opacities: _o, dcShown: _d, ...basis }: Geometry): Basis {
    return basis;
}
