/** Work in a context of somebody else, such as three.js or PlayCanvas, whose state is put back. */

/** Texture units that our passes use. */
const UNITS = 8;

/** Calls `work`, which may use another program, vertex array and textures. */
export function keepingBindings<T>(gl: WebGL2RenderingContext, work: () => T): T {
    const [program, vertexArray, active] = [gl.CURRENT_PROGRAM, gl.VERTEX_ARRAY_BINDING, gl.ACTIVE_TEXTURE].map((name) => gl.getParameter(name));
    const units = Array.from({ length: UNITS }, (_, unit) => {
        gl.activeTexture(gl.TEXTURE0 + unit);
        const bound = [gl.getParameter(gl.TEXTURE_BINDING_2D), gl.getParameter(gl.SAMPLER_BINDING)] as const;
        gl.bindSampler(unit, null);
        return bound;
    });
    try {
        return work();
    } finally {
        units.forEach(([texture, sampler], unit) => {
            gl.activeTexture(gl.TEXTURE0 + unit);
            gl.bindTexture(gl.TEXTURE_2D, texture);
            gl.bindSampler(unit, sampler);
        });
        gl.activeTexture(active);
        gl.useProgram(program);
        gl.bindVertexArray(vertexArray);
    }
}

/** Calls `work` with a state of defaults: nothing is tested, masked or blended, uploads are plain. */
export function asGuest<T>(gl: WebGL2RenderingContext, work: () => T): T {
    const get = (name: number) => gl.getParameter(name);
    const switches = [gl.BLEND, gl.CULL_FACE, gl.DEPTH_TEST, gl.SCISSOR_TEST, gl.STENCIL_TEST, gl.RASTERIZER_DISCARD].map((name) => [name, gl.isEnabled(name)] as const);
    const unpacking = [
        gl.UNPACK_ALIGNMENT, gl.UNPACK_FLIP_Y_WEBGL, gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, gl.UNPACK_ROW_LENGTH, gl.UNPACK_IMAGE_HEIGHT, gl.UNPACK_SKIP_PIXELS, gl.UNPACK_SKIP_ROWS, gl.UNPACK_SKIP_IMAGES,
    ].map((name) => [name, get(name)] as const);
    const [drawn, read, buffer] = [gl.DRAW_FRAMEBUFFER_BINDING, gl.READ_FRAMEBUFFER_BINDING, gl.PIXEL_UNPACK_BUFFER_BINDING].map(get);
    const [viewport, scissor, clear, mask] = [gl.VIEWPORT, gl.SCISSOR_BOX, gl.COLOR_CLEAR_VALUE, gl.COLOR_WRITEMASK].map(get);
    switches.forEach(([name]) => gl.disable(name));
    unpacking.forEach(([name]) => gl.pixelStorei(name, name === gl.UNPACK_ALIGNMENT ? 1 : 0));
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);
    gl.colorMask(true, true, true, true);
    try {
        return keepingBindings(gl, work);
    } finally {
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, drawn);
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
        gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, buffer);
        gl.viewport(viewport[0], viewport[1], viewport[2], viewport[3]);
        gl.scissor(scissor[0], scissor[1], scissor[2], scissor[3]);
        gl.clearColor(clear[0], clear[1], clear[2], clear[3]);
        gl.colorMask(mask[0], mask[1], mask[2], mask[3]);
        unpacking.forEach(([name, value]) => gl.pixelStorei(name, value));
        switches.forEach(([name, on]) => (on ? gl.enable(name) : gl.disable(name)));
    }
}
