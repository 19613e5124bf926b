import { support } from './errors';
import { shWidth } from './splats';

/** Memory that even the smallest file may take, and bytes of memory for each further byte of a file. */
const SMALL_BYTES = 2 ** 26;
const EXPANSION_MAX = 1040;

/** Most bytes of a scene's arrays. */
const DECODED_MAX = 2 ** 32;

/**
 * Refuses what would decode to more memory than this many bytes of a file may take. Neutral texels compress a thousandfold, so a
 * ratio alone would refuse valid files.
 */
export function checkMemory(splats: number, texels: number, shDegree: number, fileBytes: number): void {
    const bytes = splats * (61 + 4 * shWidth(shDegree)) + 12 * texels;
    const most = Math.min(DECODED_MAX, SMALL_BYTES + EXPANSION_MAX * fileBytes);
    support(bytes <= most, `bytes of ${splats} splats and ${texels} texels`, bytes, `at most ${most} in such a file`);
}
