import type { Provenance, SceneCamera, SceneInfo } from '../scene';
import { invalid } from './errors';
import { type Json, choiceOf, listOf, numberOf, numbersOf, objectOf, textOf, wholeOf } from './json';
import { flipped, product, similarityOf } from './transform';

export const COLOUR_SPACES = ['srgb_rec709_display', 'lin_rec709_display'] as const;

/** What `meta` says of a scene, with y up. */
export type Meta = Pick<SceneInfo, 'near' | 'filter' | 'background' | 'colourSpace' | 'worldFromData' | 'cameras' | 'provenance'>;

/** Reads the object `meta` (`gltf.md`, section 8). */
export function readMeta(value: unknown): Meta {
  const meta = objectOf(value, 'meta');
  const near = Math.fround(numberOf(meta.near, 'meta.near'));
  const background = numbersOf(meta.background, 'meta.background', 3).map(Math.fround) as [number, number, number];
  if (!(near >= 0 && near < Infinity)) throw invalid(`meta.near: found ${near}, expected at least 0`);
  if (!background.every((v) => v >= 0 && v <= 1)) throw invalid(`meta.background: found ${background}, expected 0 to 1`);
  const capture = similarityOf(meta.captureFromLocal, 'meta.captureFromLocal');
  const world = meta.worldFromCapture === undefined ? capture : product(similarityOf(meta.worldFromCapture, 'meta.worldFromCapture'), capture);
  return {
    near,
    background,
    filter: choiceOf(meta.filter, 'meta.filter', ['none', 'ewa']),
    colourSpace: choiceOf(meta.colourSpace, 'meta.colourSpace', COLOUR_SPACES),
    worldFromData: flipped(world),
    cameras: listOf(meta.cameras, 'meta.cameras').map((camera, i) => readCamera(camera, `meta.cameras[${i}]`)),
    provenance: readProvenance(objectOf(meta.provenance, 'meta.provenance')),
  };
}

/** A camera; `camera_from_data` is `camera_from_local` after half a turn about x (section 4). */
function readCamera(value: unknown, name: string): SceneCamera {
  const camera = objectOf(value, name);
  const rows = listOf(camera.rotationRows, `${name}.rotationRows`);
  if (rows.length !== 3) throw invalid(`${name}.rotationRows: found ${rows.length} rows, expected 3`);
  return {
    name: textOf(camera.name, `${name}.name`),
    widthPx: wholeOf(camera.widthPx, `${name}.widthPx`, 2 ** 32 - 1),
    heightPx: wholeOf(camera.heightPx, `${name}.heightPx`, 2 ** 32 - 1),
    focalPx: numbersOf(camera.focalPx, `${name}.focalPx`, 2) as [number, number],
    principalPx: numbersOf(camera.principalPx, `${name}.principalPx`, 2) as [number, number],
    rotation: rows.flatMap((row) => {
      const [x, y, z] = numbersOf(row, `${name}.rotationRows`, 3);
      return [x, 0 - y, 0 - z];
    }),
    translation: numbersOf(camera.translation, `${name}.translation`, 3) as [number, number, number],
    heldOut: camera.heldOut === true,
  };
}

function readProvenance(value: Json): Provenance {
  const text = (name: keyof Omit<Provenance, 'training'>): string => textOf(value[name], `meta.provenance.${name}`);
  const training = Object.entries(objectOf(value.training, 'meta.provenance.training'));
  return {
    title: text('title'),
    author: text('author'),
    licence: text('licence'),
    source: text('source'),
    programVersion: text('programVersion'),
    training: Object.fromEntries(training.map(([name, fact]) => [name, textOf(fact, 'meta.provenance.training')])),
  };
}
