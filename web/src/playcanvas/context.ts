/** What a graphics device of PlayCanvas is for scenes that are drawn in it. */

import { keepingBindings } from '../core/render/guest';
import { Program } from '../core/render/program';
import type { Context } from '../guest/gpu';
import { Overlay, OVERLAY_SHADERS } from '../guest/overlay';

/** The power that PlayCanvas takes for the curve of sRGB. */
const GAMMA = '#define GAMMA 2.2\n';

export class DeviceContext implements Context {
    readonly overlay: Overlay;
    lost = false;
    private readonly programs = new Map<string, Program>();

    constructor(readonly gl: WebGL2RenderingContext) {
        this.overlay = new Overlay(gl);
    }

    alive(): boolean {
        return !this.lost;
    }

    counted(): void {} // PlayCanvas counts its own textures alone

    /** Calls `work`, which draws with other programs, textures and vertex arrays, onto the first of what is bound: the others may hold depths. */
    drawing(work: () => void): void {
        const { gl } = this;
        const [first, second] = [gl.DRAW_BUFFER0, gl.DRAW_BUFFER1].map((name) => gl.getParameter(name) as number);
        if (first === gl.BACK || second === gl.NONE) return keepingBindings(gl, work);
        const all = Array.from({ length: gl.getParameter(gl.MAX_DRAW_BUFFERS) as number }, (_, i) => gl.getParameter(gl.DRAW_BUFFER0 + i) as number);
        gl.drawBuffers([first]);
        keepingBindings(gl, work);
        gl.drawBuffers(all);
    }

    /** Lays what has been drawn since `overlay.begin` over what was bound then, which holds linear light or display values. */
    endOverlay(isLinear: boolean): void {
        const { gl } = this;
        const images = this.overlay.end()!;
        this.drawing(() => {
            const program = this.program(isLinear ? GAMMA : '');
            gl.useProgram(program.program);
            program.textures(images);
            gl.uniform1i(program.uniform('linear'), isLinear ? 1 : 0);
            gl.bindVertexArray(null);
            gl.drawArrays(gl.TRIANGLES, 0, 3);
        });
    }

    dispose(): void {
        this.overlay.dispose();
        this.programs.forEach((program) => program.dispose());
    }

    private program(defines: string): Program {
        const made = this.programs.get(defines) ?? new Program(this.gl, OVERLAY_SHADERS.vertex, defines + OVERLAY_SHADERS.fragment);
        this.programs.set(defines, made);
        return made;
    }
}
