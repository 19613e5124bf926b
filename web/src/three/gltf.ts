/** Our extension of glTF for the GLTFLoader of three.js. */

import { Group, LoaderUtils, type Object3D } from 'three';
import type { GLTFLoaderPlugin, GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import { EXTENSION, KHR } from '../core/read/gltf/names';
import type { SplatsOptions } from '../guest/data';
import { loadSplats } from './loader';
import { packGlb, type Root } from './pack-glb';
import type { LitetexSplats } from './splats';

interface Mesh {
    readonly name?: string;
    readonly primitives: readonly Primitive[];
}

interface Primitive {
    readonly extensions?: { readonly [KHR]?: { readonly extensions?: { readonly [EXTENSION]?: object } } };
}

/**
 * Makes LitetexSplats of the primitives that have `LITETEX_gaussian_splatting_texture`, within `KHR_gaussian_splatting`; all
 * else is left to the loader, as are primitives of splats without our extension.
 *
 *     loader.register((parser) => new LitetexGLTFExtension(parser));
 *
 * The loader waits until all splats are there. It fails with a SceneError if they are damaged or of another version.
 */
export class LitetexGLTFExtension implements GLTFLoaderPlugin {
    readonly name = EXTENSION;

    constructor(private readonly parser: GLTFParser, private readonly options: SplatsOptions = {}) {}

    loadMesh(index: number): Promise<Group | LitetexSplats> | null {
        const { meshes } = this.parser.json as { meshes: Mesh[] };
        const mesh = meshes[index];
        const ours = mesh.primitives.filter(isOurs);
        if (ours.length === 0) return null;
        return this.load(meshes, mesh, index, ours) as Promise<Group | LitetexSplats>;
    }

    private async load(meshes: Mesh[], mesh: Mesh, index: number, ours: readonly Primitive[]): Promise<Object3D> {
        const { parser } = this;
        const objects: Object3D[] = [];
        for (const primitive of ours) {
            const splats = await loadSplats({ bytes: await this.glbOf(primitive) }, this.options);
            splats.name = parser.createUniqueName(mesh.name || `mesh_${index}`);
            parser.associations.set(splats, { meshes: index, primitives: mesh.primitives.indexOf(primitive) });
            objects.push(splats);
        }
        const others = mesh.primitives.filter((primitive) => !isOurs(primitive));
        if (others.length > 0) objects.push(await parser.loadMesh(meshes.push({ ...mesh, primitives: others }) - 1));
        return objects.length === 1 ? objects[0] : new Group().add(...objects);
    }

    /** The splats alone as a file, for the reader of such files: it gets the very bytes that the loader has. */
    private glbOf(primitive: Primitive): Promise<ArrayBuffer> {
        const { parser } = this;
        return packGlb(parser.json as Root, primitive, {
            view: (index) => parser.getDependency('bufferView', index) as Promise<ArrayBuffer>,
            file: async (uri) => {
                const { path, requestHeader } = parser.options as { path: string; requestHeader: Record<string, string> };
                const url = parser.options.manager.resolveURL(LoaderUtils.resolveURL(uri, path));
                const response = await fetch(url, { headers: requestHeader });
                if (!response.ok) throw new Error(`${url}: the server answers ${response.status} ${response.statusText}`);
                return response.arrayBuffer();
            },
        });
    }
}

function isOurs(primitive: Primitive): boolean {
    return primitive.extensions?.[KHR]?.extensions?.[EXTENSION] !== undefined;
}
