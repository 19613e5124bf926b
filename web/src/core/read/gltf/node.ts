import { check, support } from '../errors';
import { listOf, numbersOf, objectOf, wholeOf } from '../json';
import { type Matrix, fromParts, product } from '../transform';
import type { Document } from './document';

/** Largest relative difference of scales, or cosine between axes, that f32 matrices may have. */
const TOLERANCE = 1e-5;

/** `world_from_data`: the transform of the only node with a mesh; null if no node shows it (`gltf.md`, section 4). */
export function worldFromMesh(document: Document, mesh: number): Matrix | null {
    const nodes = document.list('nodes').map((node) => objectOf(node, 'node'));
    const parents: number[] = [];
    nodes.forEach(({ children }, parent) => {
        for (const child of listOf(children ?? [], 'children')) {
            const place = wholeOf(child, 'child', nodes.length - 1);
            check(parents[place] === undefined, 'parents of a node', 2, 1);
            parents[place] = parent;
        }
    });
    const showing = nodes.flatMap((node, i) => (node.mesh === mesh ? [i] : []));
    support(showing.length < 2, 'nodes of the splats', showing.length, 1);
    if (showing.length === 0) return null;
    let at: number | undefined = showing[0];
    let world = parentFromNode(nodes[at]);
    for (let depth = 0; (at = parents[at]) !== undefined; depth += 1) {
        check(depth < nodes.length, 'ancestors of a node', 'itself', 'others');
        world = product(parentFromNode(nodes[at]), world);
    }
    checkSimilarity(world);
    return world;
}

function parentFromNode({ matrix, translation, rotation, scale }: Readonly<Record<string, unknown>>): Matrix {
    if (matrix !== undefined) return numbersOf(matrix, 'matrix', 16);
    const [x, y, z, w] = numbersOf(rotation ?? [0, 0, 0, 1], 'rotation', 4);
    const norm = Math.hypot(x, y, z, w);
    support(Math.abs(norm - 1) < 1e-2, 'norm of the rotation of a node', norm, 1);
    return fromParts([w, x, y, z], numbersOf(scale ?? [1, 1, 1], 'scale', 3), numbersOf(translation ?? [0, 0, 0], 'translation', 3));
}

/** Checks that a matrix is a rotation times a positive uniform scale, with a translation. */
function checkSimilarity(m: Matrix): void {
    const scale = Math.hypot(m[0], m[1], m[2]);
    const [a, b, c, , d, e, f, , g, h, i] = m.map((value) => value / scale);
    // The third axis is that of a rotation with the first two, and these are of equal lengths and at right angles.
    const off = [
        b * f - c * e - g, c * d - a * f - h, a * e - b * d - i, d * d + e * e + f * f - 1, a * d + b * e + c * f,
        m[3], m[7], m[11], m[15] - 1,
    ];
    const isSimilar = m.every(Number.isFinite) && off.every((value) => Math.abs(value) <= TOLERANCE);
    support(isSimilar, 'transform of the node', m, 'a rotation, a positive uniform scale and a translation');
}
