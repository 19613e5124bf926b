/** Points of a scene under pixels, their distance, and the option of `litetex export` that makes it a length in metres. */

import { centreOf, type View } from '../core/render/view';
import type { SceneInfo } from '../core/scene';
import { dot, length, sub, type Vec3 } from '../viewer/vector';

/** A length as `--scale-from` takes it; a number alone is one in metres. */
const LENGTH = /^(\d+\.?\d*|\.\d+) *(mm|cm|m|in|ft)?$/;
/** Part of the distance that the digits of a coordinate tell apart. */
const PRECISION = 1e-6;

/** Where a view shows a point, px; null if it is not in front of the camera. */
export function placeOf(view: View, point: Vec3): [x: number, y: number] | null {
    const offset = sub(point, centreOf(view));
    const [x, y, z] = [0, 3, 6].map((i) => dot([view.rotation[i], view.rotation[i + 1], view.rotation[i + 2]], offset));
    if (!(z > 0)) return null;
    return [view.focalPx[0] * x / z + view.principalPx[0], view.focalPx[1] * y / z + view.principalPx[1]];
}

/** A point of the data after a similarity, column by column. */
const moved = (m: readonly number[], [x, y, z]: Vec3): Vec3 => [0, 1, 2].map((i) => m[i] * x + m[4 + i] * y + m[8 + i] * z + m[12 + i]) as Vec3;

/** Distance of two points of the data in the world, and its unit in words. */
export function distanceOf(info: SceneInfo, [a, b]: readonly [Vec3, Vec3]): { distance: number; unit: string } {
    const distance = length(sub(moved(info.worldFromData, a), moved(info.worldFromData, b)));
    return { distance, unit: info.provenance.scale.startsWith('metres') ? 'm' : 'units, unknown scale' };
}

/**
 * The option that tells the length between two points of the data, in the frame of the capture; '' if the file does not know
 * that frame. In place of a length that is none stands `...m`.
 */
export function scaleOption({ captureFromData }: SceneInfo, points: readonly [Vec3, Vec3], lengthText: string): string {
    if (!captureFromData) return '';
    const [a, b] = points.map((point) => moved(captureFromData, point));
    // Far from the origin, as in a national grid, a fixed count of digits would tell little.
    const decimals = Math.max(0, Math.min(20, Math.ceil(-Math.log10(PRECISION * length(sub(a, b))))));
    const text = (point: Vec3) => point.map((v) => v.toFixed(decimals)).join(',');
    return `--scale-from '${text(a)} ${text(b)} = ${lengthOf(lengthText) ?? '...m'}'`;
}

function lengthOf(text: string): string | null {
    const [, number, unit = 'm'] = LENGTH.exec(text.trim()) ?? [];
    return number && Number(number) > 0 ? `${number}${unit}` : null;
}
