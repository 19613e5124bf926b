import type { Splats } from '../../scene';
import { check, support } from '../errors';
import { type Json, objectOf } from '../json';
import { F32_MIN } from '../ltgs/math';
import { normAt, shWidth } from '../splats';
import { type Accessor, type Document, F32, I16, I8, U16, U8, numbersAt } from './document';
import { KHR } from './names';

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

/** Those that suffice for splats without view-dependent colours, and where they end in the binary chunk. */
export function firstOnes({ count, position, rotation, scale, opacity, sh }: Attributes): { readonly attributes: Attributes; readonly end: number } {
    const all = [position, rotation, scale, opacity, sh[0]];
    return {
        attributes: { count, degree: 0, position, rotation, scale, opacity, sh: [sh[0]] },
        end: Math.max(...all.map(({ end }) => end)),
    };
}

/** Largest third axis of a disc of another program, as a share of the smaller other one. */
const THICKNESS_MAX = 0.02;

/** Names of the SH coefficients of degree 0 to 3. */
const SH_NAMES = [0, 1, 2, 3].flatMap((l) => Array.from({ length: 2 * l + 1 }, (_, n) => `${KHR}:SH_DEGREE_${l}_COEF_${n}`));

export function findAttributes(document: Document, primitive: Json): Attributes {
    const attributes = objectOf(primitive.attributes, 'attributes');
    // Integers that the specification of KHR_gaussian_splatting and KHR_mesh_quantization allow, and whether they are normalised.
    const find = (name: string, width: number, integers: readonly number[] = [], normalised?: boolean): Accessor => {
        const found = document.accessor(attributes[name], name);
        const isWhole = integers.includes(found.component) && (normalised ?? found.normalised) === found.normalised;
        const fits = found.width === width && ((found.component === F32 && !found.normalised) || isWhole);
        check(fits, `type of ${name}`, found.component, `${F32} or ${integers.join(', ')}, ${width} numbers each`);
        return found;
    };
    const last = SH_NAMES.findLastIndex((name) => name in attributes);
    const degree = Math.floor(Math.sqrt(Math.max(last, 0)));
    const position = find('POSITION', 3, [I8, U8, I16, U16]);
    const found = {
        count: position.count,
        degree,
        position,
        rotation: find(`${KHR}:ROTATION`, 4, [I8, I16], true),
        scale: find(`${KHR}:SCALE`, 3, [U8, U16]),
        opacity: find(`${KHR}:OPACITY`, 1, [U8, U16], true),
        sh: SH_NAMES.slice(0, shWidth(degree) / 3).map((name) => find(name, 3)),
    };
    for (const { count } of [found.rotation, found.scale, found.opacity, ...found.sh]) {
        check(count === found.count, 'splats of an attribute', count, found.count);
    }
    return found;
}

/** Reads attributes as splats without maps, all of the same SH degree. `isOurs`: the third scale means nothing. */
export function readAttributes(bin: Uint8Array, attributes: Attributes, isOurs: boolean): Splats {
    const { count, degree } = attributes;
    const axes = numbersAt(bin, attributes.scale);
    const scales = new Float32Array(2 * count);
    const rotations = numbersAt(bin, attributes.rotation);
    for (let i = 0; i < count; i += 1) {
        const u = axes[3 * i];
        const v = axes[3 * i + 1];
        const thickness = axes[3 * i + 2];
        const most = Math.max(THICKNESS_MAX * Math.min(u, v), F32_MIN);
        if (!isOurs && !(thickness <= most)) {
            support(false, `third axis of an ellipsoid of ${u} x ${v}`, thickness, `discs: at most ${most}`);
        }
        scales[2 * i] = u;
        scales[2 * i + 1] = v;
        const off = Math.abs(normAt(rotations, 4 * i) - 1);
        // Quaternions of integers; others keep their bits.
        if (off > 1e-5 && off < 0.05) {
            const norm = normAt(rotations, 4 * i);
            for (let k = 4 * i; k < 4 * i + 4; k += 1) rotations[k] /= norm;
        }
    }
    const width = shWidth(degree);
    const sh = new Float32Array(width * count);
    attributes.sh.forEach((accessor, k) => {
        const values = numbersAt(bin, accessor);
        for (let i = 0; i < 3 * count; i += 1) sh[width * Math.floor(i / 3) + 3 * k + (i % 3)] = values[i];
    });
    // Other programs may store zeros.
    const positive = (values: Float32Array): Float32Array => (isOurs ? values : values.map((v) => Math.max(v, F32_MIN)));
    return {
        count,
        positions: numbersAt(bin, attributes.position),
        rotations,
        scales: positive(scales),
        opacities: positive(numbersAt(bin, attributes.opacity)),
        shDegrees: new Uint8Array(count).fill(degree),
        sh,
        rows: new Uint16Array(count),
        cols: new Uint16Array(count),
        texelSizes: new Float32Array(2 * count),
        shifts: new Int16Array(2 * count),
        texels: new Float32Array(0),
    };
}
