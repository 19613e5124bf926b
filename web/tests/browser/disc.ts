/** A disc for scenarios in engines, and what they do to their contexts. */

import type { SceneInfo, Splats } from '../../src/core/scene';

/** What a file of one splat says. */
export function infoOf(): SceneInfo {
    return {
        container: 'ltgs', quality: '', splats: 1, texels: 0, shDegree: 0, near: 0.001, filter: 'none', background: [0, 0, 0], colourSpace: 'srgb_rec709_display',
        worldFromData: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], captureFromData: null, cameras: [], home: null, bounds: null, untextured: null, standInUntil: null, fileBytes: 0,
        provenance: { title: '', author: '', licence: '', source: '', up: '', programVersion: '', scale: '', training: {} },
    };
}

/** One disc in front of the camera, as wide as `sigma`, turned about y. */
export function discOf(colour: readonly number[], z: number, sigma: number, turn = 0): Splats {
    return {
        count: 1, positions: new Float32Array([0, 0, z]), rotations: new Float32Array([0, Math.sin(turn / 2), 0, Math.cos(turn / 2)]), scales: new Float32Array([sigma, sigma]),
        opacities: new Float32Array([1]), shDegrees: new Uint8Array(1), sh: Float32Array.from(colour, (c) => (c - 0.5) / 0.28209479177387814), rows: new Uint16Array(1),
        cols: new Uint16Array(1), texelSizes: new Float32Array(2), shifts: new Int16Array(2), texels: new Float32Array(0),
    };
}

/** Takes a context away, draws, and gives it back. */
export async function loseAndRestore(gl: WebGL2RenderingContext, draw: () => void): Promise<void> {
    const extension = gl.getExtension('WEBGL_lose_context')!;
    const event = (name: string) => new Promise((resolve) => gl.canvas.addEventListener(name, resolve, { once: true }));
    const lost = event('webglcontextlost');
    extension.loseContext();
    await lost;
    draw();
    const restored = event('webglcontextrestored');
    await new Promise((resolve) => setTimeout(resolve));
    extension.restoreContext();
    await restored;
}
