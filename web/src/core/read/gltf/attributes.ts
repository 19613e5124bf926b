import type { Splats } from '../../scene';
import { invalid, unsupported } from '../errors';
import { type Json, objectOf } from '../json';
import { F32_MIN } from '../ltgs/math';
import { NO_SPLATS, shWidth } from '../splats';
import { type Accessor, type Document, F32, I16, I8, KHR, U16, U8, numbersAt } from './document';

/** Where the attributes of splats lie (`gltf.md`, section 2). */
export interface Attributes {
  readonly count: number;
  readonly degree: number;
  readonly position: Accessor;
  readonly rotation: Accessor;
  readonly scale: Accessor;
  readonly opacity: Accessor;
  /** SH coefficients up to the degree. */
  readonly sh: readonly Accessor[];
}

/** Thickness of a disc, as a share of the smaller other standard deviation. */
const THICKNESS_MAX = 0.02;

const shName = (degree: number, n: number): string => `${KHR}:SH_DEGREE_${degree}_COEF_${n}`;

export function findAttributes(document: Document, primitive: Json): Attributes {
  const attributes = objectOf(primitive.attributes, 'attributes');
  const find = (name: string, width: number, integers: readonly number[] = [], normalised?: boolean): Accessor => {
    const found = document.accessor(attributes[name], `attribute ${name}`);
    const isWhole = integers.includes(found.component) && (normalised ?? found.normalised) === found.normalised;
    if (found.width !== width || !((found.component === F32 && !found.normalised) || isWhole)) {
      throw invalid(`attribute ${name}: ${found.width} numbers of type ${found.component}, which the specification does not allow`);
    }
    return found;
  };
  const degree = [3, 2, 1].find((l) => Array.from({ length: 2 * l + 1 }, (_, n) => shName(l, n)).some((name) => name in attributes)) ?? 0;
  const names = Array.from({ length: degree + 1 }, (_, l) => Array.from({ length: 2 * l + 1 }, (_, n) => shName(l, n))).flat();
  const position = find('POSITION', 3, [I8, U8, I16, U16]);
  const found = {
    count: position.count,
    degree,
    position,
    rotation: find(`${KHR}:ROTATION`, 4, [I8, I16], true),
    scale: find(`${KHR}:SCALE`, 3, [U8, U16]),
    opacity: find(`${KHR}:OPACITY`, 1, [U8, U16], true),
    sh: names.map((name) => find(name, 3)),
  };
  for (const { count } of [found.rotation, found.scale, found.opacity, ...found.sh]) {
    if (count !== found.count) throw invalid(`attributes of ${count} and of ${found.count} splats`);
  }
  return found;
}

/** Reads attributes as splats without maps, of the same SH degree. `isOurs`: the third scale means nothing. */
export function readAttributes(bin: Uint8Array, attributes: Attributes, isOurs: boolean): Splats {
  const { count, degree } = attributes;
  const axes = numbersAt(bin, attributes.scale);
  const scales = new Float32Array(2 * count);
  for (let i = 0; i < count; i += 1) {
    const [u, v, thickness] = axes.subarray(3 * i, 3 * i + 3);
    if (!isOurs && !(thickness <= Math.max(THICKNESS_MAX * Math.min(u, v), F32_MIN))) {
      throw unsupported(`splat ${i}: an ellipsoid of ${u} x ${v} x ${thickness}; supported: discs, whose third axis is at most ${THICKNESS_MAX} of the others`);
    }
    // Other programs may store zeros.
    scales[2 * i] = isOurs ? u : Math.max(u, F32_MIN);
    scales[2 * i + 1] = isOurs ? v : Math.max(v, F32_MIN);
  }
  const opacities = numbersAt(bin, attributes.opacity);
  const width = shWidth(degree);
  const sh = new Float32Array(width * count);
  attributes.sh.forEach((accessor, k) => {
    const values = numbersAt(bin, accessor);
    for (let i = 0; i < count; i += 1) for (let c = 0; c < 3; c += 1) sh[width * i + 3 * k + c] = values[3 * i + c];
  });
  return {
    ...NO_SPLATS,
    count,
    positions: numbersAt(bin, attributes.position),
    rotations: unitRotations(numbersAt(bin, attributes.rotation)),
    scales,
    opacities: isOurs ? opacities : opacities.map((opacity) => Math.max(opacity, F32_MIN)),
    shDegrees: new Uint8Array(count).fill(degree),
    sh,
    rows: new Uint16Array(count),
    cols: new Uint16Array(count),
    texelSizes: new Float32Array(2 * count),
    shifts: new Int16Array(2 * count),
  };
}

/** Quaternions of integers made unit ones; others keep their bits. */
function unitRotations(rotations: Float32Array): Float32Array {
  for (let i = 0; i < rotations.length; i += 4) {
    const norm = Math.hypot(...rotations.subarray(i, i + 4));
    const off = Math.abs(norm - 1);
    if (off > 1e-5 && off <= 0.05) for (let k = i; k < i + 4; k += 1) rotations[k] /= norm;
  }
  return rotations;
}
