/** The splat that a ray meets. */

import type { Splats } from './scene';

/** Transmittance below which a ray has met something. */
const HALF = 0.5;
const ALPHA_MIN = 1 / 255;
const ALPHA_MAX = 0.99;

export interface Ray {
    readonly origin: readonly [number, number, number];
    /** Of unit length. */
    readonly direction: readonly [number, number, number];
    /** Distances between which hits count. */
    readonly near: number;
    readonly far: number;
}

export interface Pick {
    readonly splat: number;
    readonly distance: number;
    /** Of the splat at the hit. */
    readonly alpha: number;
    /** Of the surfel, towards the origin of the ray. */
    readonly normal: readonly [number, number, number];
}

/**
 * Where the transmittance of a ray falls below one half, with hits in the order of their distance: the surface that one
 * sees. Null where all splats together let more than half of the light pass. The low-pass filter is left out: it depends
 * on a camera.
 */
export function pick(parts: readonly { readonly first: number; readonly splats: Splats }[], ray: Ray): Pick | null {
    const hits = parts.flatMap(({ first, splats }) => hitsOf(splats, first, ray)).sort((a, b) => a.distance - b.distance);
    let transmittance = 1;
    return hits.find(({ alpha }) => (transmittance *= 1 - alpha) < HALF) ?? null;
}

function hitsOf(splats: Splats, first: number, { origin, direction: [dx, dy, dz], near, far }: Ray): Pick[] {
    const { positions, rotations, scales, opacities } = splats;
    const hits: Pick[] = [];
    for (let i = 0; i < splats.count; i++) {
        const px = positions[3 * i] - origin[0], py = positions[3 * i + 1] - origin[1], pz = positions[3 * i + 2] - origin[2];
        const opacity = opacities[i];
        const [su, sv] = [scales[2 * i], scales[2 * i + 1]];
        // The support lies within a sphere: most splats are far off.
        const along = px * dx + py * dy + pz * dz;
        const across2 = px * px + py * py + pz * pz - along * along;
        const reach2 = 2 * Math.log(255 * opacity) * Math.max(su, sv) ** 2;
        if (!(across2 <= reach2)) continue;
        const [x, y, z, w] = [rotations[4 * i], rotations[4 * i + 1], rotations[4 * i + 2], rotations[4 * i + 3]];
        const normal = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)] as const;
        const slope = normal[0] * dx + normal[1] * dy + normal[2] * dz;
        const distance = (normal[0] * px + normal[1] * py + normal[2] * pz) / slope;
        if (!(distance >= near && distance <= far)) continue;
        const hx = distance * dx - px, hy = distance * dy - py, hz = distance * dz - pz;
        const a = hx * (1 - 2 * (y * y + z * z)) + hy * 2 * (x * y + w * z) + hz * 2 * (x * z - w * y);
        const b = hx * 2 * (x * y - w * z) + hy * (1 - 2 * (x * x + z * z)) + hz * 2 * (y * z + w * x);
        const alpha = opacity * Math.exp(-0.5 * ((a / su) ** 2 + (b / sv) ** 2));
        if (!(alpha >= ALPHA_MIN)) continue;
        const side = slope > 0 ? -1 : 1;
        hits.push({ splat: first + i, distance, alpha: Math.min(ALPHA_MAX, alpha), normal: [side * normal[0], side * normal[1], side * normal[2]] });
    }
    return hits;
}
