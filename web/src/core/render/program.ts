/** Shaders of WebGL2. */

import bakeFragment from './shaders/bake.frag.glsl?raw';
import bakeVertex from './shaders/bake.vert.glsl?raw';
import colour from './shaders/colour.glsl?raw';
import fetch from './shaders/fetch.glsl?raw';
import project from './shaders/project.glsl?raw';
import quadFragment from './shaders/quad.frag.glsl?raw';
import quadVertex from './shaders/quad.vert.glsl?raw';
import recordFragment from './shaders/record.frag.glsl?raw';
import resolveFragment from './shaders/resolve.frag.glsl?raw';
import resolveVertex from './shaders/resolve.vert.glsl?raw';
import splatFragment from './shaders/splat.frag.glsl?raw';
import splatVertex from './shaders/splat.vert.glsl?raw';
import { SPLATS_PER_BATCH } from './batch';
import { COLOURS } from './colours';
import { NO_PLACE } from './layout';
import { Pool } from './pool';

/** Columns of the textures that hold records. */
export const RECORDS_PER_ROW = 1024;
/** Bits of a splat's index in its record; the rest of 32 say which copy of its map is drawn. */
const SPLAT_BITS = 26;

const VALUES = {
    SPLATS_PER_BATCH,
    RECORDS_PER_ROW,
    SPLAT_BITS,
    SPLAT_MASK: `${2 ** SPLAT_BITS - 1}u`,
    NO_MAP: `${2 ** (32 - SPLAT_BITS) - 1}u`,
    NO_PLACE: `${NO_PLACE}u`,
    ...Object.fromEntries(Object.entries(COLOURS).map(([name, value]) => [`COLOURS_${name.toUpperCase()}`, value])),
};
const DEFINES = Object.entries(VALUES).map(([name, value]) => `#define ${name} ${value}\n`).join('');

/** Sources of the exact path's shaders without `#version`, which programs such as three.js add themselves. */
export const SPLAT_SHADERS = { vertex: DEFINES + fetch + project + splatVertex, fragment: DEFINES + colour + splatFragment } as const;

/** Sources of the fast path's, which draw records. */
export const QUAD_SHADERS = { vertex: DEFINES + fetch + quadVertex, fragment: colour + quadFragment } as const;

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

    /** Binds textures by the names of their samplers, to units from `firstUnit` on. The program must be in use. */
    textures(named: Readonly<Record<string, Pool | WebGLTexture>>, firstUnit = 0): void {
        const { gl } = this;
        Object.entries(named).forEach(([name, texture], i) => {
            gl.activeTexture(gl.TEXTURE0 + firstUnit + i);
            gl.bindTexture(gl.TEXTURE_2D, texture instanceof Pool ? texture.texture : texture);
            gl.uniform1i(this.uniform(name), firstUnit + i);
        });
    }

    dispose(): void {
        this.gl.deleteProgram(this.program);
    }
}

/** The exact path's program in a variant, which lines of `#define` tell. */
export function splatProgram(gl: WebGL2RenderingContext, defines: string): Program {
    return new Program(gl, SPLAT_SHADERS.vertex, defines + SPLAT_SHADERS.fragment);
}

/** Projects splats into records. */
export function recordProgram(gl: WebGL2RenderingContext): Program {
    return new Program(gl, resolveVertex, DEFINES + fetch + project + recordFragment);
}

/** Draws records, in a variant, which lines of `#define` tell. */
export function quadProgram(gl: WebGL2RenderingContext, defines: string): Program {
    return new Program(gl, defines + QUAD_SHADERS.vertex, defines + QUAD_SHADERS.fragment);
}

/** Fills the atlas. */
export function bakeProgram(gl: WebGL2RenderingContext): Program {
    return new Program(gl, DEFINES + fetch + bakeVertex, bakeFragment);
}

export function resolveProgram(gl: WebGL2RenderingContext): Program {
    return new Program(gl, resolveVertex, resolveFragment);
}
