/** Shaders of WebGL2. */

import resolveFragment from './shaders/resolve.frag.glsl?raw';
import resolveVertex from './shaders/resolve.vert.glsl?raw';
import splatFragment from './shaders/splat.frag.glsl?raw';
import splatVertex from './shaders/splat.vert.glsl?raw';
import { COLOURS } from './colours';

const DEFINES = Object.entries(COLOURS).map(([name, value]) => `#define COLOURS_${name.toUpperCase()} ${value}\n`).join('');

/** Sources of the splats' shaders without `#version`, which programs such as three.js add themselves. */
export const SPLAT_SHADERS = { vertex: DEFINES + splatVertex, fragment: DEFINES + splatFragment } as const;

export class Program {
    readonly program: WebGLProgram;
    private readonly locations = new Map<string, WebGLUniformLocation | null>();

    constructor(private readonly gl: WebGL2RenderingContext, vertex: string, fragment: string, attributes: readonly string[] = []) {
        this.program = gl.createProgram()!;
        for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
            const shader = gl.createShader(kind)!;
            gl.shaderSource(shader, `#version 300 es\n${source}`);
            gl.compileShader(shader);
            gl.attachShader(this.program, shader);
            gl.deleteShader(shader);
        }
        attributes.forEach((name, i) => gl.bindAttribLocation(this.program, i, name));
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

/** The splats' program; `defines` are for measurements. */
export function splatProgram(gl: WebGL2RenderingContext, defines = ''): Program {
    return new Program(gl, SPLAT_SHADERS.vertex, defines + SPLAT_SHADERS.fragment, ['splat']);
}

export function resolveProgram(gl: WebGL2RenderingContext): Program {
    return new Program(gl, resolveVertex, resolveFragment);
}
