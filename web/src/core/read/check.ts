import type { Splats } from '../scene';
import { invalid } from './errors';

/** Checks that all numbers are in their ranges (`gltf.md`, sections 1 and 2). */
export function checkSplats(splats: Splats): void {
  const { count, positions, rotations, scales, opacities, sh, rows, cols, texelSizes, shifts, texels } = splats;
  for (let i = 0; i < count; i += 1) {
    for (let k = 3 * i; k < 3 * i + 3; k += 1) if (!Number.isFinite(positions[k])) throw invalid(`splat ${i}: position ${positions[k]} is not finite`);
    let norm = 0;
    for (let k = 4 * i; k < 4 * i + 4; k += 1) norm += rotations[k] * rotations[k];
    if (!(Math.abs(Math.sqrt(norm) - 1) <= 1e-5)) throw invalid(`splat ${i}: a rotation of norm ${Math.sqrt(norm)}, expected 1`);
    for (let k = 2 * i; k < 2 * i + 2; k += 1) if (!(scales[k] > 0 && scales[k] <= 1e6)) throw invalid(`splat ${i}: standard deviation ${scales[k]}, expected up to 1e6`);
    if (!(opacities[i] > 0 && opacities[i] <= 1)) throw invalid(`splat ${i}: opacity ${opacities[i]}, expected (0, 1]`);
    const isTextured = rows[i] > 0;
    for (let k = 2 * i; k < 2 * i + 2; k += 1) {
      const fits = isTextured ? texelSizes[k] > 0 && texelSizes[k] < Infinity : texelSizes[k] === 0 && shifts[k] === 0;
      if (!fits || isTextured !== cols[i] > 0) throw invalid(`splat ${i}: a map of ${rows[i]} x ${cols[i]} texels of size ${texelSizes[k]}`);
    }
  }
  for (const c of sh) if (!Number.isFinite(c)) throw invalid(`SH coefficient ${c} is not finite`);
  for (const texel of texels) if (!(texel >= -1 && texel <= 1)) throw invalid(`texel ${texel}, expected -1 to 1`);
}
