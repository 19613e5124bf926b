import { invalid, unsupported } from '../errors';
import { numbersOf, objectOf, wholeOf } from '../json';
import { type Matrix, fromParts, product } from '../transform';
import type { Document } from './document';

/** Largest relative difference of scales, or cosine between axes, that f32 matrices may have. */
const TOLERANCE = 1e-5;

/** `world_from_data`: the transform of the only node with a mesh; null if no node shows it (`gltf.md`, section 4). */
export function worldFromMesh(document: Document, mesh: number): Matrix | null {
  const nodes = document.list('nodes').map((node, i) => objectOf(node, `nodes[${i}]`));
  const parents = new Array<number | undefined>(nodes.length);
  nodes.forEach((node, i) => {
    for (const child of Array.isArray(node.children) ? node.children : []) {
      const place = wholeOf(child, `nodes[${i}].children`, nodes.length - 1);
      if (parents[place] !== undefined) throw invalid(`node ${place} has two parents`);
      parents[place] = i;
    }
  });
  const showing = [...nodes.keys()].filter((i) => nodes[i].mesh === mesh);
  if (showing.length > 1) throw unsupported(`${showing.length} nodes show the splats, supported: one`);
  if (showing.length === 0) return null;
  let world: Matrix | null = null;
  let at: number | undefined = showing[0];
  for (let depth = 0; at !== undefined; depth += 1) {
    if (depth > nodes.length) throw invalid('nodes that are their own ancestors');
    const own = parentFromNode(nodes[at], `nodes[${at}]`);
    world = world === null ? own : product(own, world);
    at = parents[at];
  }
  checkSimilarity(world!);
  return world;
}

function parentFromNode(node: Readonly<Record<string, unknown>>, name: string): Matrix {
  const { matrix, translation, rotation, scale } = node;
  if (matrix !== undefined) {
    if (translation !== undefined || rotation !== undefined || scale !== undefined) throw invalid(`${name}: a matrix and other transforms`);
    return numbersOf(matrix, `${name}.matrix`, 16);
  }
  const [x, y, z, w] = rotation === undefined ? [0, 0, 0, 1] : numbersOf(rotation, `${name}.rotation`, 4);
  if (Math.abs(Math.hypot(x, y, z, w) - 1) > 1e-2) throw unsupported(`${name}: its rotation is not a unit quaternion`);
  const scales = scale === undefined ? [1, 1, 1] : numbersOf(scale, `${name}.scale`, 3);
  return fromParts([w, x, y, z], scales, translation === undefined ? [0, 0, 0] : numbersOf(translation, `${name}.translation`, 3));
}

/** Checks that a matrix is a rotation times a positive uniform scale, with a translation. */
function checkSimilarity(m: Matrix): void {
  const columns = [0, 4, 8].map((c) => m.slice(c, c + 3));
  const dot = (a: readonly number[], b: readonly number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const lengths = columns.map((column) => Math.sqrt(dot(column, column)));
  const [x, y, z] = columns.map((column, i) => column.map((value) => value / lengths[i]));
  const across = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
  const off = [lengths[1] / lengths[0] - 1, lengths[2] / lengths[0] - 1, dot(x, y), dot(y, z), dot(x, z), dot(across, z) - 1, m[3], m[7], m[11], m[15] - 1];
  if (!m.every(Number.isFinite) || !off.every((value) => Math.abs(value) <= TOLERANCE)) {
    throw unsupported('the node of the splats: its transform is not a rotation, a positive uniform scale and a translation');
  }
}
