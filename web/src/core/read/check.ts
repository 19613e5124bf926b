import type { Splats } from '../scene';
import { check } from './errors';
import { normAt } from './splats';

/** Checks that all numbers are in their ranges (`gltf.md`, sections 1 and 2). */
export function checkSplats(splats: Splats): void {
    const { rotations, rows, cols, texelSizes, shifts } = splats;
    const all = (name: 'positions' | 'sh' | 'scales' | 'opacities' | 'texels', fits: (v: number) => boolean, range: string): void => {
        for (const v of splats[name]) if (!fits(v)) check(false, name, v, range);
    };
    all('positions', Number.isFinite, 'finite numbers');
    all('sh', Number.isFinite, 'finite numbers');
    all('scales', (s) => s > 0 && s <= 1e6, 'above 0, at most 1e6');
    all('opacities', (o) => o > 0 && o <= 1, 'above 0, at most 1');
    all('texels', (t) => t >= -1 && t <= 1, '-1 to 1');
    for (let i = 0; i < splats.count; i += 1) {
        const norm = normAt(rotations, 4 * i);
        if (!(Math.abs(norm - 1) <= 1e-5)) check(false, 'norm of a rotation', norm, 1);
        const isTextured = rows[i] > 0;
        for (let k = 2 * i; k < 2 * i + 2; k += 1) {
            const size = texelSizes[k];
            const fits = isTextured ? size > 0 && size < Infinity : size === 0 && shifts[k] === 0;
            if (!fits) check(false, `texel size of a map of ${rows[i]} x ${cols[i]}`, size, isTextured ? 'above 0' : '0, as the shift');
        }
    }
}
