/** The exact path: each corner of a quad projects its splat, each fragment filters its map as the specification says. */

import type { Batches } from './batch';
import { type Program, splatProgram } from './program';
import { type Frame, setProjection, variantOf } from './projection';

export class ExactPath {
    /** By variants: that of trained colours is made at once, while the file downloads, others when they are first needed. */
    private readonly programs = new Map<string, Program>();

    /** `defines`: see RendererOptions. */
    constructor(private readonly gl: WebGL2RenderingContext, private readonly batches: Batches, private readonly defines: string) {
        this.program('');
    }

    /** Draws onto what is bound; the caller blends. */
    draw(frame: Frame): void {
        const { gl } = this;
        const program = this.program(variantOf(frame));
        gl.useProgram(program.program);
        setProjection(gl, program, frame);
        program.textures({ texels: frame.buffers.texels }, 4);
        gl.uniform2f(program.uniform('origin'), 0, 0);
        gl.uniform2f(program.uniform('depthFromInverse'), 0, 0);
        gl.uniform2f(program.uniform('depthRange'), Math.log(frame.depthRange[0]), Math.log(frame.depthRange[1]));
        this.batches.draw(frame.drawn);
    }

    dispose(): void {
        this.programs.forEach((program) => program.dispose());
    }

    private program(variant: string): Program {
        const made = this.programs.get(variant) ?? splatProgram(this.gl, this.defines + variant);
        this.programs.set(variant, made);
        return made;
    }
}
