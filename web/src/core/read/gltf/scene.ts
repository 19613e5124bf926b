import { SceneError, type SceneInfo } from '../../scene';
import { check, support } from '../errors';
import { type Json, choiceOf, memberOf, objectOf, textOf, wholeOf } from '../json';
import { COLOUR_SPACES, type Meta, readMeta } from '../meta';
import { IDENTITY } from '../transform';
import { type Attributes, findAttributes } from './attributes';
import type { Document } from './document';
import { EXTENSION, KHR } from './names';
import { worldFromMesh } from './node';

/** Version of our extension that is read. */
const VERSION = 3;

/** The splats of a file: what its JSON says. */
export interface Found {
    readonly attributes: Attributes;
    /** Our extension; null without one that can be read. */
    readonly ours: Json | null;
    /** Whether the file was written as ours, so that the third scale means nothing. */
    readonly isOurs: boolean;
    readonly untextured: string | null;
    /** Texels, if they are known before their arrays are there. */
    readonly texels: number | null;
    readonly colourSpace: SceneInfo['colourSpace'];
    /** By the node; null if no node shows the splats. */
    readonly worldFromData: SceneInfo['worldFromData'] | null;
}

/** Finds the only primitive of splats. */
export function findScene(document: Document): Found {
    const primitives = document.list('meshes').flatMap((mesh, i) => {
        const { primitives: own } = objectOf(mesh, 'mesh');
        return Array.isArray(own) ? own.map((primitive) => ({ mesh: i, primitive: objectOf(primitive, 'primitive') })) : [];
    });
    const splatting = (primitive: Json): unknown => memberOf(primitive.extensions, KHR);
    const ofSplats = primitives.filter(({ primitive }) => splatting(primitive) !== undefined);
    if (ofSplats.length === 0 && primitives.some(({ primitive }) => isQuadMesh(primitive))) throw new SceneError('unsupported', QUADS_ONLY);
    const lost = primitives.flatMap(({ primitive }) => lossOf(primitive) ?? []);
    check(ofSplats.length > 0 || lost.length === 0, lost[0], 'no splats', `a primitive with ${KHR}`);
    support(ofSplats.length === 1, `primitives with ${KHR}`, ofSplats.length, 1);
    const { mesh, primitive } = ofSplats[0];
    check(primitive.mode === 0, 'mode of splats', primitive.mode, '0 (POINTS)');
    const khr = objectOf(splatting(primitive), KHR);
    const ours = memberOf(khr.extensions, EXTENSION);
    const version = ours === undefined ? null : wholeOf(objectOf(ours, EXTENSION).version, 'version');
    const loss = lossOf(primitive);
    const isRead = version === VERSION;
    const attributes = findAttributes(document, primitive);
    return {
        attributes,
        ours: isRead ? (ours as Json) : null,
        isOurs: version !== null || loss !== null,
        untextured: isRead ? null : version === null ? loss : `textures of version ${version}, this reader knows version ${VERSION}`,
        texels: isRead ? statedTexels(primitive, attributes.count) : 0,
        colourSpace: choiceOf(khr.colorSpace, 'colorSpace', COLOUR_SPACES),
        worldFromData: worldFromMesh(document, mesh),
    };
}

const QUADS_ONLY = 'this is a mesh of quads for programs that know no splats: open the .glb file that was written beside it';

function isQuadMesh({ extras }: Json): boolean {
    return memberOf(memberOf(extras, 'litetex'), 'kind') === 'quads';
}

/** The digest in `extras` (section 9). */
function digestOf({ extras }: Json): { readonly splats: number; readonly texels: number } | null {
    const digest = memberOf(extras, 'litetex');
    const [splats, texels] = [memberOf(digest, 'splats'), memberOf(digest, 'texels')];
    return typeof splats === 'number' && typeof texels === 'number' ? { splats, texels } : null;
}

/** Texels as the digest states them; null if it is of something else. */
function statedTexels(primitive: Json, count: number): number | null {
    const digest = digestOf(primitive);
    return digest?.splats === count && Number.isInteger(digest.texels) && digest.texels >= 0 ? digest.texels : null;
}

/** What it tells if our extension is gone; null without a digest. */
function lossOf(primitive: Json): string | null {
    const digest = digestOf(primitive);
    return digest && `a program has dropped the textures: the file was written with ${digest.texels} texels for ${digest.splats} splats`;
}

/** The metadata of splats; those without our extension have few. */
export function metaOf(document: Document, { ours, colourSpace, worldFromData }: Found): Meta {
    const { copyright, generator } = objectOf(document.root.asset, 'asset');
    const meta = ours ? readMeta(ours.meta) : foreignMeta(colourSpace, copyright, generator);
    check(meta.colourSpace === colourSpace, 'colorSpace', colourSpace, meta.colourSpace);
    return { ...meta, worldFromData: worldFromData ?? meta.worldFromData };
}

function foreignMeta(colourSpace: SceneInfo['colourSpace'], copyright: unknown, generator: unknown): Meta {
    return {
        near: Math.fround(0.01),
        filter: 'none',
        background: [0, 0, 0],
        colourSpace,
        worldFromData: IDENTITY,
        captureFromData: null,
        cameras: [],
        home: null,
        bounds: null,
        provenance: {
            title: '',
            author: '',
            licence: textOf(copyright ?? '', 'copyright'),
            source: '',
            up: '',
            programVersion: textOf(generator ?? '', 'generator'),
            scale: '',
            training: {},
        },
    };
}
