/** A scene on the GPU. */

import type { SceneInfo, SplatUpdate } from '../scene';
import { meansOfMaps, packSplats, WORDS_PER_SPLAT } from './pack';
import { Pool, poolCapacity } from './pool';

/** Numbers that colours and texels are kept in: 16 bits are enough for images (measured: 77 dB and more), 32 for tests. */
export type Storage = 'half' | 'full';

/** Beyond this, large splats hide more than they fill. */
const GROWTH_MAX = 2.5;

/**
 * How much larger splats are drawn while others are missing, so that they cover the image. Those that contribute most come
 * first, hence the fourth root. Measured on four scenes: best of 1 to 2.5 for 5 % and 20 % of the splats, 3 to 7 dB better
 * than 1.
 */
export function growthOf(splats: number, all: number): number {
    return Math.min(GROWTH_MAX, Math.max(1, all / Math.max(1, splats)) ** 0.25);
}

export class SplatBuffers {
    readonly splats: Pool;
    readonly sh: Pool;
    readonly means: Pool;
    readonly texels: Pool;
    /** Splats that are there, and how many there is room for. */
    count = 0;
    /** How much larger the first `grown` splats are drawn. */
    growth = 1;
    grown = 0;
    /** Changes with the splats. */
    version = 0;
    /** Splats that are as they were when the atlas last took them. */
    unchanged = 0;
    /** Rows + 65536 columns of each map. */
    readonly sides: Uint32Array;
    readonly capacity: number;
    /** Coefficients and texels before each splat, and behind the last. */
    private readonly coefficientsBefore: Uint32Array;
    private readonly texelsBefore: Uint32Array;

    /** `maxSplats` bounds the splats shown; so does the device. */
    constructor(private readonly gl: WebGL2RenderingContext, private readonly info: SceneInfo, storage: Storage, maxSplats = Infinity) {
        const room = poolCapacity(gl);
        const coefficients = (info.shDegree + 1) ** 2;
        this.capacity = Math.min(info.splats, maxSplats, Math.floor(room / coefficients), Math.floor(room / (WORDS_PER_SPLAT / 4)));
        const format = storage === 'half' ? 'rgb16f' : 'rgb32f';
        this.splats = new Pool(gl, 'rgba32ui', this.capacity * WORDS_PER_SPLAT / 4);
        this.sh = new Pool(gl, format, this.capacity * coefficients);
        this.means = new Pool(gl, format, this.capacity);
        this.texels = new Pool(gl, format, Math.min(info.texels, room));
        this.coefficientsBefore = new Uint32Array(this.capacity + 1);
        this.texelsBefore = new Uint32Array(this.capacity + 1);
        this.sides = new Uint32Array(this.capacity);
    }

    get bytes(): number {
        return [this.splats, this.sh, this.means, this.texels].reduce((sum, pool) => sum + pool.bytes, 0);
    }

    get numTexels(): number {
        return this.texelsBefore[this.count];
    }

    /** Takes splats; returns those kept, of which there may be fewer. */
    apply(update: SplatUpdate): number {
        const { first, splats } = update;
        const room = poolCapacity(this.gl);
        const [coefficients, texels] = [this.coefficientsBefore, this.texelsBefore];
        let kept = 0;
        for (; kept < splats.count && first + kept < this.capacity; kept++) {
            const at = first + kept;
            const more = splats.rows[kept] * splats.cols[kept];
            if (texels[at] + more > room) break;
            this.sides[at] = splats.rows[kept] + 65536 * splats.cols[kept];
            texels[at + 1] = texels[at] + more;
            coefficients[at + 1] = coefficients[at] + (splats.shDegrees[kept] + 1) ** 2;
        }
        this.count = first + kept;
        this.unchanged = Math.min(this.unchanged, first);
        this.version++;
        this.grow(update);
        const words = packSplats(splats, coefficients[first], texels[first]);
        this.splats.write(first * WORDS_PER_SPLAT / 4, words.subarray(0, kept * WORDS_PER_SPLAT));
        this.sh.write(coefficients[first], splats.sh.subarray(0, 3 * (coefficients[this.count] - coefficients[first])));
        this.texels.write(texels[first], splats.texels.subarray(0, 3 * (texels[this.count] - texels[first])));
        this.means.write(first, meansOfMaps(splats).subarray(0, 3 * kept));
        return kept;
    }

    /** Of a layer in arrival, parts of the scene are there: they stay as they are, and what lies elsewhere stays grown. */
    private grow({ first, complete }: SplatUpdate): void {
        const isPart = !complete && first > 0 && this.count < this.capacity;
        this.grown = isPart ? first : this.count;
        this.growth = growthOf(this.grown, this.info.splats);
    }

    dispose(): void {
        for (const pool of [this.splats, this.sh, this.means, this.texels]) pool.dispose();
    }
}
