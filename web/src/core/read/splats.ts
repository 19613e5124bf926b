import type { SplatUpdate, Splats } from '../scene';

/** Coefficients of a degree and those below, RGB. */
export function shWidth(degree: number): number {
  return 3 * (degree + 1) * (degree + 1);
}

/** SH of degree 0 to 3, each with the sign that half a turn about x gives its coefficients (`gltf.md`, section 9). */
export const SH_SIGNS = [1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];

export const NO_SPLATS: Splats = {
  count: 0,
  positions: new Float32Array(0),
  rotations: new Float32Array(0),
  scales: new Float32Array(0),
  opacities: new Float32Array(0),
  shDegrees: new Uint8Array(0),
  sh: new Float32Array(0),
  rows: new Uint16Array(0),
  cols: new Uint16Array(0),
  texelSizes: new Float32Array(0),
  shifts: new Int16Array(0),
  texels: new Float32Array(0),
};

const NAMES = ['positions', 'rotations', 'scales', 'opacities', 'shDegrees', 'sh', 'rows', 'cols', 'texelSizes', 'shifts', 'texels'] as const;

/** All splats of some parts, in their order. */
export function concatenate(parts: readonly Splats[]): Splats {
  if (parts.length === 1) return parts[0];
  const joined = Object.fromEntries(
    NAMES.map((name) => {
      const length = parts.reduce((sum, part) => sum + part[name].length, 0);
      const Kind = NO_SPLATS[name].constructor as new (length: number) => Float32Array;
      const all = new Kind(length);
      let at = 0;
      for (const part of parts) {
        all.set(part[name], at);
        at += part[name].length;
      }
      return [name, all];
    }),
  );
  return { count: parts.reduce((sum, part) => sum + part.count, 0), ...joined } as Splats;
}

/** The splats from one on up to, but without, another; arrays share their memory. */
export function sliced(splats: Splats, first: number, end: number): Splats {
  if (first === 0 && end >= splats.count) return splats;
  const { rows, cols, shDegrees } = splats;
  const ends = [first, end].map((stop) => {
    let sh = 0;
    let texels = 0;
    for (let i = 0; i < stop; i += 1) {
      sh += shWidth(shDegrees[i]);
      texels += rows[i] * cols[i];
    }
    return { sh, texels: 3 * texels };
  });
  const part = <T extends { subarray(from: number, to: number): T }>(array: T, width: number): T => array.subarray(width * first, width * end);
  return {
    count: end - first,
    positions: part(splats.positions, 3),
    rotations: part(splats.rotations, 4),
    scales: part(splats.scales, 2),
    opacities: part(splats.opacities, 1),
    shDegrees: part(shDegrees, 1),
    sh: splats.sh.subarray(ends[0].sh, ends[1].sh),
    rows: part(rows, 1),
    cols: part(cols, 1),
    texelSizes: part(splats.texelSizes, 2),
    shifts: part(splats.shifts, 2),
    texels: splats.texels.subarray(ends[0].texels, ends[1].texels),
  };
}

/** Collects the splats of a scene from its updates. */
export class SceneSplats {
  private parts: Splats[] = [];

  /** Applies an update: it replaces all splats from its first on. */
  apply(update: SplatUpdate): void {
    let before = 0;
    const kept: Splats[] = [];
    for (const part of this.parts) {
      if (before >= update.first) break;
      kept.push(sliced(part, 0, Math.min(part.count, update.first - before)));
      before += part.count;
    }
    this.parts = [...kept, update.splats];
  }

  /** All splats so far. */
  get splats(): Splats {
    return this.parts.length === 0 ? NO_SPLATS : concatenate(this.parts);
  }
}
