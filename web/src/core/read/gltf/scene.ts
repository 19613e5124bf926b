import type { SceneInfo } from '../../scene';
import { invalid, quoted, unsupported } from '../errors';
import { type Json, choiceOf, objectOf, textOf, wholeOf } from '../json';
import { COLOUR_SPACES, type Meta, readMeta } from '../meta';
import { IDENTITY } from '../transform';
import { type Attributes, findAttributes } from './attributes';
import { type Document, EXTENSION, KHR } from './document';
import { worldFromMesh } from './node';

/** Version of our extension that is read. */
const VERSION = 2;

/** The splats of a file: what its JSON says. */
export interface Found {
  readonly attributes: Attributes;
  /** Our extension; null without one that can be read. */
  readonly ours: Json | null;
  /** Whether the third scale means nothing: the file is ours. */
  readonly isOurs: boolean;
  readonly untextured: string | null;
  readonly colourSpace: SceneInfo['colourSpace'];
  /** Place of the splats in the file's frame; null: not stated. */
  readonly worldFromData: SceneInfo['worldFromData'] | null;
  /** What to say of a file without our extension. */
  readonly meta: Meta;
}

interface Place {
  readonly mesh: number;
  readonly primitive: Json;
}

/** Finds the only primitive of splats. */
export function findScene(document: Document): Found {
  const { mesh, primitive } = onlyPrimitive(document);
  if (primitive.mode !== 0) throw invalid(`splats of mode ${quoted(primitive.mode)}, expected 0 (POINTS)`);
  const splatting = objectOf(objectOf(primitive.extensions, 'extensions')[KHR], KHR);
  const ours = memberOf(splatting.extensions, EXTENSION);
  const version = ours === undefined ? undefined : wholeOf(objectOf(ours, EXTENSION).version, `${EXTENSION}: version`);
  const digest = digestOf(primitive);
  const colourSpace = choiceOf(splatting.colorSpace, `${KHR}: colorSpace`, COLOUR_SPACES);
  const isRead = version === VERSION;
  return {
    attributes: findAttributes(document, primitive),
    ours: isRead ? (ours as Json) : null,
    isOurs: version !== undefined || digest !== null,
    untextured: isRead ? null : version !== undefined ? `the textures are of version ${version}, this reader knows version ${VERSION}` : digest,
    colourSpace,
    worldFromData: worldFromMesh(document, mesh),
    meta: foreignMeta(document, colourSpace),
  };
}

/** Our extension's `meta`, which must name the colour space of KHR_gaussian_splatting. */
export function ownMeta(found: Found): Meta {
  const meta = found.ours === null ? found.meta : readMeta(found.ours.meta);
  if (meta.colourSpace !== found.colourSpace) throw invalid(`${KHR}: colorSpace ${found.colourSpace}, the metadata say ${meta.colourSpace}`);
  return { ...meta, worldFromData: found.worldFromData ?? meta.worldFromData };
}

function onlyPrimitive(document: Document): Place {
  const places = document.list('meshes').flatMap((mesh, i) => {
    const { primitives } = objectOf(mesh, `meshes[${i}]`);
    return (Array.isArray(primitives) ? primitives : []).map((primitive): Place => ({ mesh: i, primitive: objectOf(primitive, 'primitive') }));
  });
  const ofSplats = places.filter(({ primitive }) => memberOf(primitive.extensions, KHR) !== undefined);
  if (ofSplats.length > 1) throw unsupported(`${ofSplats.length} primitives of splats, supported: one`);
  if (ofSplats.length === 1) return ofSplats[0];
  const lost = places.map(({ primitive }) => digestOf(primitive)).find((digest) => digest !== null);
  throw lost ? invalid(`no splats: ${lost}`) : unsupported(`no primitive with ${KHR}: not a file of splats`);
}

/** What the digest in `extras` tells once our extension is gone; null without a digest (section 9). */
function digestOf(primitive: Json): string | null {
  const digest = memberOf(primitive.extras, 'litetex') as Json | undefined;
  const [splats, texels] = [memberOf(digest, 'splats'), memberOf(digest, 'texels')];
  if (typeof splats !== 'number' || typeof texels !== 'number') return null;
  return `the file was written with ${texels} texels for ${splats} splats, but a program that processed it has dropped the textures`;
}

function memberOf(value: unknown, name: string): unknown {
  return typeof value === 'object' && value !== null ? (value as Json)[name] : undefined;
}

/** What is known of splats without our metadata. */
function foreignMeta(document: Document, colourSpace: SceneInfo['colourSpace']): Meta {
  const asset = objectOf(document.root.asset, 'asset');
  const text = (name: string): string => (asset[name] === undefined ? '' : textOf(asset[name], `asset.${name}`));
  return {
    near: Math.fround(0.01),
    filter: 'none',
    background: [0, 0, 0],
    colourSpace,
    worldFromData: IDENTITY,
    cameras: [],
    provenance: { title: '', author: '', licence: text('copyright'), source: '', programVersion: text('generator'), training: {} },
  };
}
