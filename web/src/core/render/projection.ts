/** What both paths tell the shaders of an image. */

import type { SceneInfo } from '../scene';
import { growthOf, type SplatBuffers } from './buffers';
import { classColours, COLOURS, type Colours } from './colours';
import type { Pool } from './pool';
import type { Program } from './program';
import { centreOf, type View } from './view';

/** More splats than there are. */
export const ALL = 0xffffffff;

/** An image to draw. */
export interface Frame {
    readonly view: View;
    readonly info: SceneInfo;
    readonly buffers: SplatBuffers;
    /** Splats far to near, how many, and a number that changes with them. */
    readonly order: Pool;
    readonly drawn: number;
    readonly orderVersion: number;
    readonly colours: Colours;
    /** At most this many splats are drawn, the first of the file. */
    readonly budget: number;
    /** Depths that are shown as white and black where colours show depth. */
    readonly depthRange: readonly [near: number, far: number];
    /** Depth of clip space where others are tested against: x + y / distance + slope . (px from the principal point). */
    readonly depth?: { readonly fromInverse: readonly [number, number]; readonly slope: readonly [number, number] };
    /** How the colours of each splat are converted: to linear light, or to sRGB. */
    readonly conversion?: 'TO_LINEAR' | 'TO_SRGB' | null;
}

/** Sets the textures and uniforms of `project.glsl`. */
export function setProjection(gl: WebGL2RenderingContext, program: Program, { view, info, buffers, order, drawn, budget, colours }: Frame): void {
    const u = (name: string) => program.uniform(name);
    program.textures({ splats: buffers.splats, sh: buffers.sh, means: buffers.means, order });
    gl.uniform1i(u('drawn'), drawn);
    gl.uniformMatrix3fv(u('cameraFromData'), true, view.rotation);
    gl.uniform3f(u('translation'), ...view.translation);
    gl.uniform3f(u('cameraInData'), ...centreOf(view));
    gl.uniform2f(u('focal'), ...view.focalPx);
    gl.uniform2f(u('principal'), ...view.principalPx);
    gl.uniform2f(u('size'), view.widthPx, view.heightPx);
    gl.uniform1f(u('near'), info.near);
    const isCut = budget < buffers.count;
    gl.uniform1ui(u('budget'), isCut ? budget : ALL);
    gl.uniform1f(u('growth'), isCut ? growthOf(budget, info.splats) : buffers.growth);
    gl.uniform1ui(u('grown'), isCut ? budget : buffers.grown);
    gl.uniform1i(u('filtered'), info.filter === 'ewa' ? 1 : 0);
    gl.uniform1i(u('colours'), COLOURS[colours]);
    gl.uniform3fv(u('classColours'), classColours(colours));
}

/** Lines of `#define` for what an image shows. */
export function variantOf({ colours, conversion }: Frame): string {
    return (colours === 'depth' ? '#define SHOWS_DEPTH\n' : '') + (conversion ? `#define ${conversion}\n` : '');
}
