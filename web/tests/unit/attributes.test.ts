/** Attributes of the element: those it observes, those that JSX and templates type, and those that are documented. */

import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect, test } from 'vitest';
import { ATTRIBUTES, isOn } from '../../src/element/attributes';
import type { ViewerAttributes } from '../../src/element/markup';

/** The compiler refuses a name that the types lack, and a type whose name is missing. */
const TYPED: Record<keyof ViewerAttributes, true> = {
    src: true, alt: true, 'camera-controls': true, 'controls-mode': true, 'disable-zoom': true, 'auto-rotate': true, 'rotation-per-second': true, view: true,
    background: true, colours: true, 'max-splats': true, precision: true, 'keep-near': true, loading: true,
};

/** Names in the first column of the first table that has one of attributes. */
function documented(path: string): string[] {
    const table = /\| attribute \| meaning \|\n.*\n((?:[ *]*\|.*\n)+)/.exec(readFileSync(join(import.meta.dirname, '../..', path), 'utf8'))![1];
    return table.split('\n').flatMap((row) => [...(/^[ *]*\|(.*?)\|/.exec(row)?.[1] ?? '').matchAll(/`([\w-]+)`/g)].map(([, name]) => name));
}

test('the same names everywhere', () => {
    const names = [...ATTRIBUTES].sort();
    expect(Object.keys(TYPED).sort()).toEqual(names);
    for (const path of ['README.md', 'src/element/index.ts']) expect([path, ...documented(path).sort()]).toEqual([path, ...names]);
});

test('on or off', () => {
    const of = (value: string | null) => isOn({ getAttribute: () => value }, 'auto-rotate');
    expect(['', 'true', 'auto-rotate', null, 'false'].map(of)).toEqual([true, true, true, false, false]);
});
