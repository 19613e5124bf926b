import { check } from '../errors';
import { numberOf, numbersOf, objectOf, wholeOf } from '../json';
import { F32_MAX } from './math';

type StepName = 'position' | 'tilt' | 'twist' | 'log2Scale' | 'log2Opacity' | 'sh0' | 'texel' | 'chroma' | 'log2TexelSize';

/** Steps by which numbers of a lossy file are rounded (`ltgs.md`, section 4). */
export type Steps = Readonly<Record<StepName, number>> & { readonly shRest: readonly number[] };

/** Numbers of the scene to which the steps refer. */
export interface Grid {
    readonly origin: readonly number[];
    readonly reach: number;
    readonly bits: number;
    readonly cellBits: number;
    readonly log2Scale: number;
    readonly log2TexelSize: number;
}

export interface Quantiser {
    readonly steps: Steps;
    readonly grid: Grid;
}

export function readQuantiser(value: unknown): Quantiser {
    const quantiser = objectOf(value, 'quantiser');
    const steps = objectOf(quantiser.steps, 'steps');
    const grid = objectOf(quantiser.grid, 'grid');
    const step = (name: StepName): number => numberOf(steps[name], name, 2 ** -30, 16);
    const within = (name: keyof Grid, least = -F32_MAX): number => numberOf(grid[name], name, least, F32_MAX);
    const cellBits = wholeOf(grid.cellBits, 'cellBits', 31);
    const bits = wholeOf(grid.bits, 'bits', Math.min(31, cellBits + 21));
    check(bits >= cellBits, 'bits', bits, `at least ${cellBits}`);
    return {
        steps: {
            position: step('position'),
            tilt: step('tilt'),
            twist: step('twist'),
            log2Scale: step('log2Scale'),
            log2Opacity: step('log2Opacity'),
            sh0: step('sh0'),
            shRest: numbersOf(steps.shRest, 'shRest', 3, 2 ** -30, 16),
            texel: step('texel'),
            chroma: step('chroma'),
            log2TexelSize: step('log2TexelSize'),
        },
        grid: {
            origin: numbersOf(grid.origin, 'origin', 3, -F32_MAX, F32_MAX),
            reach: within('reach', 2 ** -1022),
            bits,
            cellBits,
            log2Scale: within('log2Scale'),
            log2TexelSize: within('log2TexelSize'),
        },
    };
}
