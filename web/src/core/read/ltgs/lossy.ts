import type { ChunkDecoder } from './chunk';
import { readGeometry } from './geometry';
import type { Quantiser } from './quantiser';
import { readSh } from './sh';
import { readTexels } from './texels';

/** Decodes the chunks of a balanced, tiny or custom file of an SH degree. */
export function lossy(fileDegree: number, quantiser: Quantiser): ChunkDecoder {
    return {
        geometry: (block, count) => readGeometry(block, count, quantiser),
        sh: (block, geometry) => readSh(block, geometry, fileDegree, quantiser.steps),
        texels: (block, geometry) => readTexels(block, geometry, quantiser.steps),
    };
}
