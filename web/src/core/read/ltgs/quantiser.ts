import { invalid } from '../errors';
import { numberOf, numbersOf, objectOf, wholeOf } from '../json';
import { F32_MAX } from './math';

const STEPS = ['position', 'tilt', 'twist', 'log2Scale', 'log2Opacity', 'sh0', 'texel', 'chroma', 'log2TexelSize'] as const;

/** Steps by which numbers of a lossy file are rounded (`ltgs.md`, section 4). */
export type Steps = Readonly<Record<(typeof STEPS)[number], number>> & { readonly shRest: readonly number[] };

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
  const bits = wholeOf(grid.bits, 'grid.bits', 31);
  const cellBits = wholeOf(grid.cellBits, 'grid.cellBits', bits);
  const found = {
    steps: {
      ...(Object.fromEntries(STEPS.map((name) => [name, numberOf(steps[name], `steps.${name}`)])) as Record<(typeof STEPS)[number], number>),
      shRest: numbersOf(steps.shRest, 'steps.shRest', 3),
    },
    grid: {
      origin: numbersOf(grid.origin, 'grid.origin', 3),
      reach: numberOf(grid.reach, 'grid.reach'),
      bits,
      cellBits,
      log2Scale: numberOf(grid.log2Scale, 'grid.log2Scale'),
      log2TexelSize: numberOf(grid.log2TexelSize, 'grid.log2TexelSize'),
    },
  };
  for (const step of Object.values(found.steps).flat()) {
    if (!(step >= 2 ** -30 && step <= 16)) throw invalid(`steps: found ${step}, expected 2^-30 to 16`);
  }
  const { origin, reach, log2Scale, log2TexelSize } = found.grid;
  const isBounded = [...origin, reach, log2Scale, log2TexelSize].every((v) => Math.abs(v) <= F32_MAX);
  if (bits > cellBits + 21 || !isBounded || reach < 2 ** -1022) throw invalid('grid: its numbers are out of bounds');
  return found;
}
