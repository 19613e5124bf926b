import { SH_SIGNS } from '../splats';
import { type Basis, type Sh, roomForSh, withDegree } from './chunk';
import { putColour } from './colours';
import { readDegrees } from './maps';
import { signed } from './math';
import type { Steps } from './quantiser';
import type { Block } from './streams';

/** Values of the contexts of a coefficient (`ltgs.md`, section 4.3). */
const MEANS = 20;
const SECOND = 17 * MEANS;
const THIRD = 100;

/** Decodes the SH block of a lossy chunk (section 4.1). */
export function readSh(block: Block, { count, steppers }: Basis, fileDegree: number, steps: Steps): Sh {
    const { classes, factors } = steppers!;
    const out = roomForSh(readDegrees(block, count, fileDegree, classes));
    // t of section 4.3 by channel and splat.
    const sums = [0, 1, 2].map(() => new Uint32Array(count));
    for (let degree = 1; degree <= fileDegree; degree += 1) {
        const { splats, places } = withDegree(out.degrees, degree);
        const first = degree * degree;
        const end = first + 2 * degree + 1;
        const size = splats.length * (end - first);
        // 10 Y + G.
        const known = new Uint8Array(size);
        const [luma, green, red] = sums.map((sum, channel) => {
            const numbers = new Int32Array(size);
            const stream = block.begin(size, SECOND, THIRD);
            if (stream === null) return numbers;
            for (let k = first, at = 0; k < end; k += 1) {
                for (const i of splats) {
                    const mean = k > 1 ? Math.min(MEANS - 1, Math.floor((2 * sum[i]) / (k - 1))) : 0;
                    numbers[at] = signed(stream.next(MEANS * classes[i] + mean, known[at]));
                    sum[i] += stream.length;
                    known[at] += [10, 1, 0][channel] * Math.min(stream.length, 9);
                    at += 1;
                }
            }
            stream.end();
            return numbers;
        });
        for (let k = first, at = 0; k < end; k += 1) {
            splats.forEach((i, place) => {
                const step = steps.shRest[degree - 1] * factors[i];
                const chroma = step * steps.chroma;
                const to = places[place] + 3 * (k - first);
                putColour(out.sh, to, luma[at] * step, green[at] * chroma, red[at] * chroma, SH_SIGNS[k]);
                at += 1;
            });
        }
    }
    return out;
}
