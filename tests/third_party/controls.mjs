// Broken copies of a file, negative controls of the rendering test: files from writers with wrong frames or signs.
//
//     node controls.mjs FILE.glb mirrored=OUT.glb sh-signs=OUT.glb ...

import { KHR, accessor, edit, primitive, read, write } from './gltf.mjs';

const SH_SIGNS = [[1], [-1, -1, 1], [-1, 1, 1, -1, 1], [-1, 1, -1, -1, 1, -1, 1]];

const BREACHES = {
    /** The scene mirrored in x. */
    mirrored: (file, attributes) => {
        edit(file, attributes.POSITION, (v, c) => (c === 0 ? -v : v));
        edit(file, attributes[`${KHR}:ROTATION`], (v, c) => (c === 1 || c === 2 ? -v : v));
    },
    /** Positions converted from y down to y up, rotations not. */
    rotations: (file, attributes) => {
        const q = accessor(file, attributes[`${KHR}:ROTATION`]).array;
        let i = 0;
        // (x, y, z, w) with y up is (w, -z, y, -x) with y down.
        edit(file, attributes[`${KHR}:ROTATION`], (_, c) => {
            const at = 4 * Math.floor(i++ / 4);
            return [q[at + 3], -q[at + 2], q[at + 1], -q[at]][c];
        });
    },
    /** SH coefficients left in the frame with y down. */
    'sh-signs': (file, attributes) => SH_SIGNS.forEach((signs, degree) => signs.forEach((sign, n) => {
        const index = attributes[`${KHR}:SH_DEGREE_${degree}_COEF_${n}`];
        if (index !== undefined && sign < 0) edit(file, index, (v) => -v);
    })),
};

const [source, ...targets] = process.argv.slice(2);
for (const target of targets) {
    const [name, path] = target.split(/=(.*)/s);
    const file = read(source);
    BREACHES[name](file, primitive(file).attributes);
    write(path, file);
}
