/** What the attributes of the element say. */

import { COLOURS, type Colours } from '../core/render/colours';
import type { Precision } from '../viewer/pace';
import type { ViewerAttributes } from './markup';

/** What has attributes: an element, or the address of a page. */
export type Attributes = Pick<Element, 'getAttribute'>;

export const ATTRIBUTES: readonly (keyof ViewerAttributes)[] = ['src', 'alt', 'camera-controls', 'controls-mode', 'disable-zoom', 'auto-rotate', 'rotation-per-second', 'view', 'background', 'colours', 'max-splats', 'precision', 'keep-near', 'loading'];

/** Whether an attribute is there that is on or off. Many frameworks write "false" for off. */
export function isOn(element: Attributes, name: string): boolean {
    return (element.getAttribute(name) ?? 'false') !== 'false';
}

export function maxSplatsOf(element: Attributes): number {
    const most = Math.floor(Number(element.getAttribute('max-splats')));
    return most >= 1 ? most : Infinity;
}

export function precisionOf(element: Attributes): Precision {
    const precision = element.getAttribute('precision');
    return precision === 'exact' || precision === 'fast' ? precision : 'auto';
}

export function coloursOf(element: Attributes): Colours {
    const colours = element.getAttribute('colours') ?? 'trained';
    return Object.hasOwn(COLOURS, colours) ? colours as Colours : 'trained';
}

/** Of the camera around places of photos, where the attribute names none. */
const DEFAULT_REACH = 0.3;

export function reachOf(element: Attributes): number {
    const text = element.getAttribute('keep-near');
    return text === null ? Infinity : Number(text) > 0 ? Number(text) : DEFAULT_REACH;
}

/** Null: transparent. Undefined: that of the scene. */
export function backgroundOf(element: Attributes): readonly [number, number, number] | null | undefined {
    const text = element.getAttribute('background') ?? 'scene';
    if (text === 'transparent') return null;
    const digits = /^#([0-9a-f]{6})$/i.exec(text)?.[1];
    return digits ? [0, 2, 4].map((at) => parseInt(digits.slice(at, at + 2), 16) / 255) as [number, number, number] : undefined;
}

/** Radians per second, if it turns by itself. */
export function rotationOf(element: Attributes): number {
    const degrees = Number(element.getAttribute('rotation-per-second') ?? 12);
    return Number.isFinite(degrees) ? degrees * Math.PI / 180 : 0;
}
