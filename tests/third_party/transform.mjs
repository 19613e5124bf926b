// Judge: programs that rewrite glTF. What glTF-Transform and gltfpack make of a file must either be whole (the same hash) or
// our reader must say that the textures are gone; never a scene that silently lost them.
//
//     node transform.mjs BINARY FILE.glb

import { spawnSync } from 'node:child_process';
import { createRequire } from 'node:module';
import { Extension, ExtensionProperty, Logger, NodeIO, PropertyType, RefList, TextureInfo, VertexLayout } from '@gltf-transform/core';
import { dedup, prune } from '@gltf-transform/functions';
import { KHR, OURS } from './gltf.mjs';
import { finish } from './report.mjs';

const ARRAYS = ['rects', 'texelSize', 'pages', 'sh0'];
/** A tool has dropped the textures; the content is not what its hash says. */
const [DROPPED, CHANGED] = ['LT1026', 'LT1025'];

/** The object of both extensions: arrays and textures as references, the rest as it came. */
class Splatting extends ExtensionProperty {
    init() {
        this.extensionName = KHR;
        this.propertyType = 'Splatting';
        this.parentTypes = [PropertyType.PRIMITIVE];
    }
    getDefaults() {
        const arrays = Object.fromEntries(ARRAYS.map((name) => [name, null]));
        return Object.assign(super.getDefaults(), { ...arrays, textures: new RefList(), json: {} });
    }
}

/** An extension for glTF-Transform that passes both on, but for what `lose` takes out of the JSON. */
function passing(lose) {
    return class extends Extension {
        static EXTENSION_NAME = KHR;
        extensionName = KHR;

        read({ jsonDoc, accessors, textures, meshes }) {
            jsonDoc.json.meshes.forEach((mesh, m) => mesh.primitives.forEach((primitive, p) => {
                const json = structuredClone(primitive.extensions[KHR]);
                lose(json);
                const property = new Splatting(this.document.getGraph());
                const ours = json.extensions?.[OURS] ?? {};
                for (const name of ARRAYS.filter((name) => name in ours)) property.setRef(name, accessors[ours[name]]);
                for (const page of ours.atlas ?? []) property.addRef('textures', textures[jsonDoc.json.textures[page.texture].source]);
                meshes[m].listPrimitives()[p].setExtension(KHR, property.set('json', json));
            }));
            return this;
        }

        write(context) {
            for (const mesh of this.document.getRoot().listMeshes()) {
                mesh.listPrimitives().forEach((primitive, p) => {
                    const property = primitive.getExtension(KHR);
                    const json = structuredClone(property.get('json'));
                    const ours = json.extensions?.[OURS] ?? {};
                    for (const name of ARRAYS.filter((name) => name in ours)) {
                        ours[name] = context.accessorIndexMap.get(property.getRef(name));
                    }
                    property.listRefs('textures').forEach((texture, i) => {
                        const info = new TextureInfo(this.document.getGraph());
                        ours.atlas[i].texture = context.createTextureInfoDef(texture, info).index;
                    });
                    const def = context.jsonDoc.json.meshes[context.meshIndexMap.get(mesh)].primitives[p];
                    def.extensions = { ...def.extensions, [KHR]: json };
                });
            }
            return this;
        }
    };
}

/** Lists our extension as used; the other one passes it on. */
class Ours extends Extension {
    static EXTENSION_NAME = OURS;
    extensionName = OURS;
    read() {
        return this;
    }
    write() {
        return this;
    }
}

const [binary, source] = process.argv.slice(2);
const target = (name) => source.replace(/\.glb$/, `.${name}.glb`);

/** What our program says of a file: codes of errors, exit code of inspect, hash, all texts. */
function ask(path) {
    const run = (...args) => spawnSync(binary, args, { encoding: 'utf8' });
    const [validated, inspected] = [run('validate', '--json', path), run('inspect', '--json', path)];
    const issues = JSON.parse(validated.stdout).issues.filter((issue) => issue.severity === 'error');
    const codes = [...new Set(issues.map((issue) => issue.code))];
    if ((validated.status === 0) !== (codes.length === 0)) codes.push(`exit code ${validated.status}`);
    const hash = inspected.status === 0 ? JSON.parse(inspected.stdout).hash : null;
    return { codes, hash, inspect: inspected.status, said: inspected.stderr };
}

/** Passes a file through glTF-Transform. */
async function transform(name, extensions, changes = []) {
    const io = new NodeIO().setLogger(new Logger(Logger.Verbosity.SILENT)).registerExtensions(extensions);
    // Interleaved: other strides than ours.
    io.setVertexLayout(VertexLayout.INTERLEAVED);
    const document = await io.read(source);
    document.setLogger(new Logger(Logger.Verbosity.SILENT));
    await document.transform(...changes);
    await io.write(target(name), document);
    return ask(target(name));
}

const problems = [];
const original = ask(source);
if (original.codes.length > 0 || !original.hash) problems.push(`control: the file itself has ${original.codes}`);

/** The textures are gone, and both commands say so. */
function expectDropped(name, found) {
    const told = /textures/.test(found.said);
    if (!found.codes.includes(DROPPED) || !told) {
        problems.push(`${name}: issues [${found.codes}], expected ${DROPPED}; inspect ended with ${found.inspect} and said: ${found.said.trim()}`);
    }
}

function expectWhole(name, found) {
    if (found.codes.length > 0 || found.hash !== original.hash) {
        problems.push(`${name}: issues [${found.codes}], hash ${found.hash}, expected none and ${original.hash}`);
    }
}

expectDropped('glTF-Transform as it is', await transform('stock', []));
const withoutOurs = passing((json) => delete json.extensions);
expectDropped('glTF-Transform that knows KHR_gaussian_splatting', await transform('khr', [withoutOurs]));
expectWhole('glTF-Transform that passes all on', await transform('whole', [passing(() => {}), Ours]));
expectWhole('the same with dedup and prune', await transform('pruned', [passing(() => {}), Ours], [dedup(), prune()]));

const partly = await transform('partly', [passing((json) => delete json.extensions[OURS].sh0), Ours]);
if (!partly.codes.includes(CHANGED)) problems.push(`control "sh0 lost" has issues [${partly.codes}], expected ${CHANGED}`);

const gltfpack = createRequire(import.meta.url).resolve('gltfpack/cli.js');
const packed = {};
for (const [name, options] of Object.entries({ pack: [], packke: ['-ke', '-noq'] })) {
    const ran = spawnSync(process.execPath, [gltfpack, '-i', source, '-o', target(name), ...options], { encoding: 'utf8' });
    if (ran.status !== 0) {
        problems.push(`gltfpack ${options}: ${ran.status} ${ran.stderr}`);
        continue;
    }
    packed[name] = ask(target(name));
    if (packed[name].hash === original.hash) continue;
    if (packed[name].codes.length === 0) problems.push(`gltfpack ${options}: no error, yet another hash`);
}
finish('glTF-Transform, gltfpack', `passed on: same hash; dropped: ${DROPPED}; partly: ${CHANGED}; `
    + `gltfpack: ${Object.values(packed).map((p) => p.codes.join(' ') || 'same hash').join(', ')}`, problems);
