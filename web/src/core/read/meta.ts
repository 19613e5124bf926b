import type { Provenance, SceneCamera, SceneInfo } from '../scene';
import { check } from './errors';
import { type Json, choiceOf, listOf, numberOf, numbersOf, objectOf, textOf, wholeOf } from './json';
import { F32_MAX } from './ltgs/math';
import { flipped, fromParts, HALF_TURN, product, similarityOf } from './transform';

export const COLOUR_SPACES = ['srgb_rec709_display', 'lin_rec709_display'] as const;

/** What `meta` says of a scene, with y up. */
export type Meta = Pick<
    SceneInfo,
    'near' | 'filter' | 'background' | 'colourSpace' | 'worldFromData' | 'captureFromData' | 'cameras' | 'home' | 'bounds' | 'provenance'
>;

/** Reads the object `meta` (`gltf.md`, section 8). */
export function readMeta(value: unknown): Meta {
    const meta = objectOf(value, 'meta');
    const capture = similarityOf(meta.captureFromLocal, 'captureFromLocal');
    const { worldFromCapture } = meta;
    const world = worldFromCapture === undefined ? capture : product(similarityOf(worldFromCapture, 'worldFromCapture'), capture);
    const cameras = listOf(meta.cameras, 'cameras').map(readCamera);
    const home = meta.home === undefined ? null : wholeOf(meta.home, 'home');
    check(home === null || home < cameras.length, 'home', home, 'the index of a camera');
    return {
        near: Math.fround(numberOf(meta.near, 'near', 0, F32_MAX)),
        background: numbersOf(meta.background, 'background', 3, 0, 1).map(Math.fround) as [number, number, number],
        filter: choiceOf(meta.filter, 'filter', ['none', 'ewa']),
        colourSpace: choiceOf(meta.colourSpace, 'colourSpace', COLOUR_SPACES),
        worldFromData: flipped(world),
        captureFromData: product(capture, HALF_TURN),
        cameras,
        home,
        bounds: meta.bounds === undefined ? null : readBounds(meta.bounds),
        provenance: readProvenance(meta.provenance),
    };
}

/** A box of the local frame, after half a turn about x. */
function readBounds(value: unknown): NonNullable<SceneInfo['bounds']> {
    const bounds = objectOf(value, 'bounds');
    const [low, high] = [bounds.min, bounds.max].map((corner) => numbersOf(corner, 'bounds', 3));
    check(low.every((v, i) => v <= high[i]), 'bounds', [low, high], 'min up to max');
    return { min: [low[0], -high[1], -high[2]], max: [high[0], -low[1], -low[2]] };
}

/** A camera; `camera_from_data` is `camera_from_local` after half a turn about x (section 4). */
function readCamera(value: unknown): SceneCamera {
    const camera = objectOf(value, 'camera');
    return {
        name: textOf(camera.name, 'camera'),
        widthPx: wholeOf(camera.widthPx, 'widthPx'),
        heightPx: wholeOf(camera.heightPx, 'heightPx'),
        focalPx: numbersOf(camera.focalPx, 'focalPx', 2) as [number, number],
        principalPx: numbersOf(camera.principalPx, 'principalPx', 2) as [number, number],
        rotation: rowsOf(camera).flatMap((row) => row.map((v, i) => (i > 0 ? 0 - v : v))),
        translation: numbersOf(camera.translation, 'translation', 3) as [number, number, number],
        heldOut: camera.heldOut === true,
    };
}

/** The rotation of a camera: `rotationRows`, or in lossy `.ltgs` files a quaternion wxyz of any length but 0 (`ltgs.md`, section 1.2). */
function rowsOf({ rotation, rotationRows }: Json): number[][] {
    if (rotation === undefined) {
        const rows = listOf(rotationRows, 'rotationRows');
        check(rows.length === 3, 'rotationRows', rows, '3 rows');
        return rows.map((row) => numbersOf(row, 'rotationRows', 3));
    }
    const quaternion = numbersOf(rotation, 'rotation', 4);
    const matrix = fromParts(quaternion, [1, 1, 1], [0, 0, 0]);
    check(matrix.every(Number.isFinite), 'rotation', quaternion, 'a quaternion');
    return [0, 1, 2].map((row) => [matrix[row], matrix[row + 4], matrix[row + 8]]);
}

function readProvenance(value: unknown): Provenance {
    const provenance = objectOf(value, 'provenance');
    const facts = Object.entries(objectOf(provenance.training, 'training'));
    const names = ['title', 'author', 'licence', 'source', 'programVersion'];
    return Object.fromEntries([
        ...names.map((name) => [name, textOf(provenance[name], name)]),
        ['up', textOf(provenance.up ?? '', 'up')],
        ['scale', textOf(provenance.scale ?? '', 'scale')],
        ['training', Object.fromEntries(facts.map(([name, fact]) => [name, textOf(fact, 'training')]))],
    ]) as unknown as Provenance;
}
