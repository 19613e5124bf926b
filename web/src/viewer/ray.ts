/** Rays through places of an image. */

import type { Ray } from '../core/pick';
import { centreOf, type View } from '../core/render/view';
import { add, length, scale, type Vec3 } from './vector';

/** The ray through a place of the image, px from the upper left corner. Surfaces before the near plane do not count. */
export function rayThrough(view: View, [x, y]: readonly [number, number], near: number): Ray {
    const r = view.rotation;
    const slope = [(x - view.principalPx[0]) / view.focalPx[0], (y - view.principalPx[1]) / view.focalPx[1], 1];
    const along = [0, 1, 2].map((c) => slope[0] * r[c] + slope[1] * r[3 + c] + r[6 + c]) as Vec3;
    const perDepth = length(along);
    return { origin: centreOf(view), direction: scale(along, 1 / perDepth), near: near * perDepth, far: Infinity };
}

/** The point of a ray at a distance. */
export const pointAt = ({ origin, direction }: Ray, distance: number): Vec3 => add([...origin], [...direction], distance);
