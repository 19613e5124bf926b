/** Shaders of WebGL2. */

import resolveFragment from './shaders/resolve.frag.glsl?raw';
import resolveVertex from './shaders/resolve.vert.glsl?raw';
import splatFragment from './shaders/splat.frag.glsl?raw';
import splatVertex from './shaders/splat.vert.glsl?raw';
import { SPLATS_PER_BATCH } from './batch';
import { COLOURS } from './colours';

const VALUES = { SPLATS_PER_BATCH, ...Object.fromEntries(Object.entries(COLOURS).map(([name, value]) => [`COLOURS_${name.toUpperCase()}`, value])) };
const DEFINES = Object.entries(VALUES).map(([name, value]) => `#define ${name} ${value}\n`).join('');

/** Sources of the splats' shaders without `#version`, which programs such as three.js add themselves. */
export const SPLAT_SHADERS = { vertex: DEFINES + splatVertex, fragment: DEFINES + splatFragment } as const;

export class Program {
    readonly program: WebGLProgram;
    private readonly locations = new Map<string, WebGLUniformLocation | null>();

    constructor(private readonly gl: WebGL2RenderingContext, vertex: string, fragment: string) {
        this.program = gl.createProgram()!;
        for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
            const shader = gl.createShader(kind)!;
            gl.shaderSource(shader, `#version 300 es\n${source}`);
            gl.compileShader(shader);
            gl.attachShader(this.program, shader);
            gl.deleteShader(shader);
        }
        gl.linkProgram(this.program);
        if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost()) {
            const logs = gl.getAttachedShaders(this.program)!.map((shader) => gl.getShaderInfoLog(shader));
            throw new Error(`the driver refuses a shader: ${[gl.getProgramInfoLog(this.program), ...logs].join('\n')}`);
        }
    }

    uniform(name: string): WebGLUniformLocation | null {
        if (!this.locations.has(name)) this.locations.set(name, this.gl.getUniformLocation(this.program, name));
        return this.locations.get(name)!;
    }

    dispose(): void {
        this.gl.deleteProgram(this.program);
    }
}

/** The splats' program in a variant, which lines of `#define` tell. */
export function splatProgram(gl: WebGL2RenderingContext, defines: string): Program {
    return new Program(gl, SPLAT_SHADERS.vertex, defines + SPLAT_SHADERS.fragment);
}

export function resolveProgram(gl: WebGL2RenderingContext): Program {
    return new Program(gl, resolveVertex, resolveFragment);
}
