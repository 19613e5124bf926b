import type { SceneInfo } from '../core/scene';
import type { Vec3 } from './vector';

export interface Sphere {
    readonly centre: Vec3;
    readonly radius: number;
}

/** A sphere around the bulk of a scene, in the data: what the file says, else by its centres. */
export function sceneBounds({ bounds }: Pick<SceneInfo, 'bounds'>, positions: () => Float32Array): Sphere {
    if (!bounds) return boundsOf(positions());
    const { min, max } = bounds;
    return {
        centre: min.map((low, i) => 0.5 * (low + max[i])) as Vec3,
        radius: Math.max(0.5 * Math.hypot(...min.map((low, i) => max[i] - low)), 1e-6),
    };
}

/**
 * A sphere around most of a scene: the medians of its centres, and the distance within which nine of ten lie. Floaters and
 * backdrops, which are few, do not count.
 */
export function boundsOf(positions: Float32Array): Sphere {
    const count = positions.length / 3;
    if (count === 0) return { centre: [0, 0, 0], radius: 1 };
    const step = Math.max(1, Math.floor(count / 20_000));
    const axis = (c: number) => {
        const values = new Float64Array(Math.ceil(count / step));
        for (let i = 0, at = 0; at < count; i++, at += step) values[i] = positions[3 * at + c];
        return values.sort();
    };
    const centre = [0, 1, 2].map((c) => { const sorted = axis(c); return sorted[sorted.length >> 1]; }) as Vec3;
    const distances = new Float64Array(Math.ceil(count / step));
    for (let i = 0, at = 0; at < count; i++, at += step) distances[i] = Math.hypot(...[0, 1, 2].map((c) => positions[3 * at + c] - centre[c]));
    distances.sort();
    return { centre, radius: Math.max(distances[Math.floor(0.9 * (distances.length - 1))], 1e-6) };
}

/** Radius in an image of what lies within a radius at a distance; Infinity if the camera is within. */
export function radiusPx(radius: number, distance: number, focalPx: number): number {
    return distance > radius ? (focalPx * radius) / Math.sqrt(distance ** 2 - radius ** 2) : Infinity;
}
