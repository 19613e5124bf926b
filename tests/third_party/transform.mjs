// Rewrites a file with glTF-Transform and gltfpack. The result must either be complete (same hash), or our reader must
// report that the textures are gone: textures are never lost silently.
//
//     node transform.mjs BINARY FILE.glb

import { spawnSync } from 'node:child_process';
import { createRequire } from 'node:module';
import { Extension, ExtensionProperty, Logger, NodeIO, PropertyType, RefList, TextureInfo, VertexLayout } from '@gltf-transform/core';
import { dedup, prune } from '@gltf-transform/functions';
import { KHR, OURS } from './gltf.mjs';
import { finish } from './report.mjs';

const ARRAYS = ['rects', 'texelSize', 'shift', 'shDegree', 'pages', 'sh0'];
/** Issue codes: a tool dropped the textures; the content does not match its hash. */
const [DROPPED, CHANGED] = ['LT1026', 'LT1025'];

/** The object of both extensions: arrays and textures as references, the rest unchanged. */
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

/** A glTF-Transform extension that preserves both of ours, except what `lose` removes from the JSON. */
function preserving(lose) {
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

/** Declares our extension as used; the KHR extension preserves its content. */
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

/** Result of our commands for a file: error codes of validate; exit code, hash and messages of inspect. */
function check(path) {
    const run = (...args) => spawnSync(binary, args, { encoding: 'utf8' });
    const [validated, inspected] = [run('validate', '--json', path), run('inspect', '--json', path)];
    const issues = JSON.parse(validated.stdout).issues.filter((issue) => issue.severity === 'error');
    const codes = [...new Set(issues.map((issue) => issue.code))];
    if ((validated.status === 0) !== (codes.length === 0)) codes.push(`exit code ${validated.status}`);
    const hash = inspected.status === 0 ? JSON.parse(inspected.stdout).hash : null;
    return { codes, hash, inspect: inspected.status, messages: inspected.stderr };
}

/** Rewrites the source with glTF-Transform and checks the result. */
async function transform(name, extensions, changes = []) {
    const io = new NodeIO().setLogger(new Logger(Logger.Verbosity.SILENT)).registerExtensions(extensions);
    // Interleaved, to get strides unlike ours.
    io.setVertexLayout(VertexLayout.INTERLEAVED);
    const document = await io.read(source);
    document.setLogger(new Logger(Logger.Verbosity.SILENT));
    await document.transform(...changes);
    await io.write(target(name), document);
    return check(target(name));
}

const problems = [];
const original = check(source);
if (original.codes.length > 0 || !original.hash) problems.push(`control: the source itself has issues [${original.codes}]`);

/** The textures are gone, and both commands report it. */
function expectDropped(name, found) {
    const reported = /textures/.test(found.messages);
    if (!found.codes.includes(DROPPED) || !reported) {
        problems.push(`${name}: issues [${found.codes}], expected ${DROPPED}; inspect exited with ${found.inspect}: ${found.messages.trim()}`);
    }
}

function expectComplete(name, found) {
    if (found.codes.length > 0 || found.hash !== original.hash) {
        problems.push(`${name}: issues [${found.codes}], hash ${found.hash}, expected none and ${original.hash}`);
    }
}

expectDropped('unmodified glTF-Transform', await transform('stock', []));
const withoutOurs = preserving((json) => delete json.extensions);
expectDropped('glTF-Transform with KHR_gaussian_splatting', await transform('khr', [withoutOurs]));
expectComplete('glTF-Transform with both extensions', await transform('complete', [preserving(() => {}), Ours]));
expectComplete('the same with dedup and prune', await transform('pruned', [preserving(() => {}), Ours], [dedup(), prune()]));

const partly = await transform('partly', [preserving((json) => delete json.extensions[OURS].sh0), Ours]);
if (!partly.codes.includes(CHANGED)) problems.push(`control "sh0 lost" has issues [${partly.codes}], expected ${CHANGED}`);

const gltfpack = createRequire(import.meta.url).resolve('gltfpack/cli.js');
const packed = {};
for (const [name, options] of Object.entries({ pack: [], packke: ['-ke', '-noq'] })) {
    const ran = spawnSync(process.execPath, [gltfpack, '-i', source, '-o', target(name), ...options], { encoding: 'utf8' });
    if (ran.status !== 0) {
        problems.push(`gltfpack ${options}: ${ran.status} ${ran.stderr}`);
        continue;
    }
    packed[name] = check(target(name));
    if (packed[name].hash === original.hash) continue;
    if (packed[name].codes.length === 0) problems.push(`gltfpack ${options}: another hash, but no error`);
}
finish('glTF-Transform, gltfpack', `preserved: same hash; dropped: ${DROPPED}; partly dropped: ${CHANGED}; `
    + `gltfpack: ${Object.values(packed).map((p) => p.codes.join(' ') || 'same hash').join(', ')}`, problems);
