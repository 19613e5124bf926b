// Validates glTF with Khronos' validator. It rejects attribute names that contain a colon (its issue 252), so each
// attribute of KHR_gaussian_splatting gives one error; exactly these are allowed.
//
//     node validator.mjs FILE...

import { existsSync, readFileSync } from 'node:fs';
import { basename, dirname, join } from 'node:path';
import validator from 'gltf-validator';
import { KHR, copy, primitive, read, write } from './gltf.mjs';
import { finish } from './report.mjs';

const ALLOWED = new RegExp(
    `^/meshes/0/primitives/0/attributes/${KHR}:(ROTATION|SCALE|OPACITY|SH_DEGREE_[0-3]_COEF_[0-6])$`);

/** `{problems, allowed, warnings}` of a file: `allowed` is the number of errors that are allowed. */
async function validate(path) {
    const report = await validator.validateBytes(new Uint8Array(readFileSync(path)), {
        uri: basename(path),
        maxIssues: 0,
        externalResourceFunction: async (uri) => {
            const file = join(dirname(path), decodeURIComponent(uri));
            if (!existsSync(file)) throw new Error(`${file} is missing`);
            return new Uint8Array(readFileSync(file));
        },
    });
    const names = Object.keys(primitive(read(path)).attributes).filter((n) => n.startsWith(`${KHR}:`));
    const errors = report.issues.messages.filter((m) => m.severity === 0);
    const wrong = errors.filter((m) => m.code !== 'MESH_PRIMITIVE_INVALID_ATTRIBUTE' || !ALLOWED.test(m.pointer));
    const problems = wrong.map((m) => `${basename(path)}: ${m.code} ${m.pointer}: ${m.message}`);
    const allowed = errors.length - wrong.length;
    if (allowed !== names.length || report.issues.truncated || report.issues.numErrors !== errors.length) {
        problems.push(`${basename(path)}: ${allowed} attribute errors for ${names.length} attributes`);
    }
    return { problems, allowed, warnings: report.issues.numWarnings };
}

/** Negative controls: each must be caught. */
const BREACHES = {
    'wrong bounds of POSITION': (f) => (f.json.accessors[primitive(f).attributes.POSITION].min[0] += 1),
    'accessor beyond its view': (f) => (f.json.accessors[primitive(f).attributes[`${KHR}:OPACITY`]].count += 1000),
    'unknown attribute': (f) => (primitive(f).attributes[`${KHR}:GLOSS`] = primitive(f).attributes[`${KHR}:OPACITY`]),
    'node with a missing mesh': (f) => (f.json.nodes[0].mesh = 7),
};

const files = process.argv.slice(2);
const problems = [];
let [allowed, warnings] = [0, 0];
for (const path of files) {
    const found = await validate(path);
    problems.push(...found.problems);
    allowed += found.allowed;
    warnings += found.warnings;
}
const valid = files.find((path) => path.endsWith('.glb') && primitive(read(path)).extensions?.[KHR]);
for (const [name, breach] of Object.entries(BREACHES)) {
    const file = copy(read(valid));
    breach(file);
    const path = valid.replace(/\.glb$/, '.broken.glb');
    write(path, file);
    if ((await validate(path)).problems.length === 0) problems.push(`control "${name}" was not caught`);
}
finish('gltf-validator', `${files.length} files, ${allowed} allowed attribute errors, 0 others, ${warnings} warnings; `
    + `${Object.keys(BREACHES).length} controls caught`, problems);
