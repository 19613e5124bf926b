import type { SplatUpdate, Splats } from '../scene';

/** Numbers of the SH coefficients of a degree and those below, RGB. */
export function shWidth(degree: number): number {
    return 3 * (degree + 1) * (degree + 1);
}

/** Norm of the quaternion at a place. */
export function normAt(rotations: Float32Array, at: number): number {
    const [x, y, z, w] = [rotations[at], rotations[at + 1], rotations[at + 2], rotations[at + 3]];
    return Math.sqrt(x * x + y * y + z * z + w * w);
}

/** Signs of SH coefficients under half a turn about x (`gltf.md`, section 9). */
export const SH_SIGNS = [1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];

/** The first numbers of splat `i` in `sh` and in `texels`; those behind the last splat for `count`. */
function endsOf({ shDegrees, rows, cols }: Splats, i: number): readonly [sh: number, texels: number] {
    let sh = 0;
    let texels = 0;
    for (let k = 0; k < i; k += 1) {
        sh += shWidth(shDegrees[k]);
        texels += 3 * rows[k] * cols[k];
    }
    return [sh, texels];
}

type Arrays = Omit<Splats, 'count'>;
type AnyArray = Float32Array;

/** Numbers of a splat in each array; 0 where it depends on the splat. */
const WIDTHS: Readonly<Record<keyof Arrays, number>> = {
    positions: 3,
    rotations: 4,
    scales: 2,
    opacities: 1,
    shDegrees: 1,
    sh: 0,
    rows: 1,
    cols: 1,
    texelSizes: 2,
    shifts: 2,
    texels: 0,
};

function mapped(count: number, array: (name: keyof Arrays, width: number) => unknown): Splats {
    const entries = Object.entries(WIDTHS).map(([name, width]) => [name, array(name as keyof Arrays, width)]);
    return { count, ...(Object.fromEntries(entries) as Arrays) };
}

/** All splats of some parts, at least one, in their order. */
export function concatenate(parts: readonly Splats[]): Splats {
    if (parts.length === 1) return parts[0];
    return mapped(
        parts.reduce((sum, part) => sum + part.count, 0),
        (name) => {
            const arrays = parts.map((part) => part[name] as AnyArray);
            const Kind = arrays[0].constructor as new (length: number) => AnyArray;
            const all = new Kind(arrays.reduce((sum, array) => sum + array.length, 0));
            arrays.reduce((at, array) => (all.set(array, at), at + array.length), 0);
            return all;
        },
    );
}

/** The first `count` splats; arrays share their memory. */
export function firstOf(splats: Splats, count: number): Splats {
    if (count >= splats.count) return splats;
    const [sh, texels] = endsOf(splats, count);
    return mapped(count, (name, width) => splats[name].subarray(0, name === 'sh' ? sh : name === 'texels' ? texels : width * count));
}

/** Collects the splats of a scene from its updates. */
export class SceneSplats {
    private parts: Splats[] = [];

    /** Applies an update: it replaces all splats from its first on. */
    apply(update: SplatUpdate): void {
        let before = 0;
        this.parts = this.parts.flatMap((part) => {
            const kept = Math.min(part.count, update.first - before);
            before += part.count;
            return kept > 0 ? [firstOf(part, kept)] : [];
        });
        this.parts.push(update.splats);
    }

    /** All splats so far; null before the first update. */
    get splats(): Splats | null {
        return this.parts.length === 0 ? null : concatenate(this.parts);
    }
}
