/** Runs the listings of `exporters/schema/draw.md`: what an engine does around them, as plainly as they are written. */

import { DataUtils } from 'three';
import { readScene, SceneSplats } from '../../src/core/read';
import type { SceneInfo, Splats } from '../../src/core/scene';
import { viewOf, type View } from '../../src/core/render/view';

// The compiler knows the interfaces of WebGPU, but not these.
declare const GPUBufferUsage: Record<'COPY_DST' | 'MAP_READ' | 'STORAGE' | 'UNIFORM', number>;
declare const GPUTextureUsage: Record<'COPY_SRC' | 'RENDER_ATTACHMENT', number>;
declare const GPUMapMode: Record<'READ', number>;

export type Listings = { vertex: string; fragment: string } | { wgsl: string };

/** Damages on purpose, for negative controls. */
export type Control = 'order' | 'no-texels' | 'transposed' | 'half-pixel';

export interface Drawing {
    url: string;
    view: string;
    listings: Listings;
    control?: Control;
}

interface Scene {
    info: SceneInfo;
    splats: Splats;
    view: View;
    /** From far to near. */
    order: Uint32Array;
    /** First texel of each map in the pool. */
    first: Uint32Array;
}

async function sceneOf({ url, view: name, control }: Drawing): Promise<Scene> {
    const all = new SceneSplats();
    const bytes = await (await fetch(url)).arrayBuffer();
    const info = await readScene(bytes, { onUpdate: (update) => all.apply(update) });
    const splats = all.splats!;
    let view = viewOf(info.cameras.find((camera) => camera.name === name)!);
    if (control === 'half-pixel') view = { ...view, principalPx: [view.principalPx[0] + 0.5, view.principalPx[1]] };
    const [x, y, z] = view.rotation.slice(6);
    const depth = Float32Array.from({ length: splats.count }, (_, i) => {
        const at = splats.positions.subarray(3 * i, 3 * i + 3);
        return x * at[0] + y * at[1] + z * at[2] + view.translation[2];
    });
    const order = Uint32Array.from(depth.keys()).sort((i, k) => depth[k] - depth[i] || k - i);
    if (control === 'order') order.reverse();
    const first = new Uint32Array(splats.count);
    for (let i = 1; i < splats.count; i++) first[i] = first[i - 1] + splats.rows[i - 1] * splats.cols[i - 1];
    const { rows, cols, texels } = splats;
    if (control === 'no-texels') return { info, view, order, first, splats: { ...splats, texels: texels.map(() => 0) } };
    if (control === 'transposed') return { info, view, order, first, splats: { ...splats, rows: cols, cols: rows } };
    return { info, view, order, first, splats };
}

/** RGB of 16 coefficients a splat, `width` numbers each. */
function coefficientsOf({ count, sh, shDegrees }: Splats, width: number): Float32Array {
    const all = new Float32Array(16 * width * count);
    for (let i = 0, at = 0; i < count; i++) {
        for (let k = 0; k < (shDegrees[i] + 1) ** 2; k++, at += 3) all.set(sh.subarray(at, at + 3), width * (16 * i + k));
    }
    return all;
}

/** Columns of camera_from_data, `height` numbers each. */
function columnsOf({ rotation }: View, height: number): Float32Array {
    const columns = new Float32Array(3 * height);
    for (let k = 0; k < 9; k++) columns[height * (k % 3) + Math.floor(k / 3)] = rotation[k];
    return columns;
}

const varianceOf = (info: SceneInfo) => (info.filter === 'ewa' ? 0.1 : 0);

/** Premultiplied RGBA, rows from the top. */
function drawWebGL({ info, splats, view, order, first }: Scene, { vertex, fragment }: { vertex: string; fragment: string }): Float32Array {
    const { widthPx, heightPx } = view;
    const gl = document.createElement('canvas').getContext('webgl2')!;
    gl.getExtension('EXT_color_buffer_float');
    const program = gl.createProgram()!;
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]] as const) {
        const shader = gl.createShader(kind)!;
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader)!);
        gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program)!);
    gl.useProgram(program);

    let unit = 0;
    const texture = (name: string, format: GLenum, width: number, height: number, type: GLenum, data: Float32Array | null) => {
        const made = gl.createTexture();
        gl.activeTexture(gl.TEXTURE0 + unit);
        gl.bindTexture(gl.TEXTURE_2D, made);
        gl.texImage2D(gl.TEXTURE_2D, 0, format, width, height, 0, format === gl.RGB32F ? gl.RGB : gl.RGBA, type, data);
        for (const parameter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, parameter, gl.NEAREST);
        if (name) gl.uniform1i(gl.getUniformLocation(program, name), unit++);
        return made;
    };
    const inRows = (format: GLenum, channels: number, data: Float32Array, width = 100) => {
        const height = Math.ceil(data.length / channels / width);
        const padded = new Float32Array(channels * width * height);
        padded.set(data);
        return [format, width, height, gl.FLOAT, padded] as const;
    };
    // A page as glTF has it: maps side by side, on shelves as high as the highest map.
    const page = { width: Math.max(64, ...splats.cols), height: 0, places: [] as [number, number][] };
    const shelf = Math.max(1, ...splats.rows);
    for (let i = 0, x = 0, y = 0; i < splats.count; i++) {
        if (x + splats.cols[i] > page.width) [x, y] = [0, y + shelf];
        page.places.push([x, y]);
        x += splats.cols[i];
        page.height = y + shelf;
    }
    // What no map covers means nothing: here, a colour that would be seen.
    const texels = new Float32Array(3 * page.width * page.height).fill(1);
    const records = new Float32Array(20 * splats.count);
    for (let i = 0; i < splats.count; i++) {
        const [rows, cols, [x, y]] = [splats.rows[i], splats.cols[i], page.places[i]];
        for (let row = 0; row < rows; row++) texels.set(splats.texels.subarray(3 * (first[i] + row * cols), 3 * (first[i] + (row + 1) * cols)), 3 * ((y + row) * page.width + x));
        records.set([
            ...splats.positions.subarray(3 * i, 3 * i + 3), splats.opacities[i], ...splats.rotations.subarray(4 * i, 4 * i + 4),
            ...splats.scales.subarray(2 * i, 2 * i + 2), ...splats.texelSizes.subarray(2 * i, 2 * i + 2), x, y, cols, rows, ...splats.shifts.subarray(2 * i, 2 * i + 2),
        ], 20 * i);
    }
    texture('splats', ...inRows(gl.RGBA32F, 4, records));
    texture('coefficients', ...inRows(gl.RGB32F, 3, coefficientsOf(splats, 3)));
    texture('page', gl.RGB32F, page.width, page.height, gl.FLOAT, texels);
    const at = (name: string) => gl.getUniformLocation(program, name);
    gl.uniformMatrix3fv(at('cameraFromData'), false, columnsOf(view, 3));
    gl.uniform3fv(at('translation'), view.translation);
    gl.uniform2fv(at('focal'), view.focalPx);
    gl.uniform2fv(at('principal'), view.principalPx);
    gl.uniform2f(at('size'), widthPx, heightPx);
    gl.uniform1f(at('near'), info.near);
    gl.uniform1f(at('variance'), varianceOf(info));

    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, order, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(0, 1);
    gl.activeTexture(gl.TEXTURE0 + unit);
    const target = texture('', gl.RGBA16F, widthPx, heightPx, gl.HALF_FLOAT, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target, 0);
    gl.viewport(0, 0, widthPx, heightPx);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, splats.count);
    const pixels = new Float32Array(4 * widthPx * heightPx);
    gl.readPixels(0, 0, widthPx, heightPx, gl.RGBA, gl.FLOAT, pixels);
    const error = gl.getError();
    if (error) throw new Error(`WebGL error ${error}`);
    gl.getExtension('WEBGL_lose_context')!.loseContext();
    const flipped = new Float32Array(pixels.length);
    for (let row = 0; row < heightPx; row++) flipped.set(pixels.subarray(4 * widthPx * row, 4 * widthPx * (row + 1)), 4 * widthPx * (heightPx - 1 - row));
    return flipped;
}

/** Premultiplied RGBA, rows from the top. */
async function drawWebGPU({ info, splats, view, order, first }: Scene, code: string): Promise<Float32Array> {
    const { widthPx, heightPx } = view;
    const adapter = await navigator.gpu?.requestAdapter();
    if (!adapter) throw new Error('the browser has no WebGPU');
    const device = await adapter.requestDevice();
    device.pushErrorScope('validation');
    const module = device.createShaderModule({ code });
    const messages = (await module.getCompilationInfo()).messages.map((message) => `${message.lineNum}: ${message.message}`);
    if (messages.length > 0) throw new Error(messages.join('\n'));
    const pipeline = device.createRenderPipeline({
        layout: 'auto',
        vertex: { module },
        fragment: {
            module,
            targets: [{ format: 'rgba16float', blend: { color: { srcFactor: 'one', dstFactor: 'one-minus-src-alpha' }, alpha: { srcFactor: 'one', dstFactor: 'one-minus-src-alpha' } } }],
        },
        primitive: { topology: 'triangle-strip' },
    });
    const records = new Float32Array(20 * splats.count), words = new Uint32Array(records.buffer);
    for (let i = 0; i < splats.count; i++) {
        records.set([
            ...splats.positions.subarray(3 * i, 3 * i + 3), splats.opacities[i], ...splats.rotations.subarray(4 * i, 4 * i + 4),
            ...splats.scales.subarray(2 * i, 2 * i + 2), ...splats.texelSizes.subarray(2 * i, 2 * i + 2), ...splats.shifts.subarray(2 * i, 2 * i + 2),
        ], 20 * i);
        words.set([splats.rows[i], splats.cols[i], first[i]], 20 * i + 14);
    }
    const camera = new Float32Array([...columnsOf(view, 4), ...view.translation, info.near, ...view.focalPx, ...view.principalPx, widthPx, heightPx, varianceOf(info), 0]);
    const buffer = (data: Float32Array<ArrayBuffer> | Uint32Array<ArrayBuffer>, usage: GPUBufferUsageFlags) => {
        const made = device.createBuffer({ size: Math.max(16, data.byteLength), usage: usage | GPUBufferUsage.COPY_DST });
        device.queue.writeBuffer(made, 0, data);
        return made;
    };
    const stored = [records, coefficientsOf(splats, 4), splats.texels as Float32Array<ArrayBuffer>, order] as (Float32Array<ArrayBuffer> | Uint32Array<ArrayBuffer>)[];
    const buffers = [buffer(camera, GPUBufferUsage.UNIFORM), ...stored.map((data) => buffer(data, GPUBufferUsage.STORAGE))];
    const target = device.createTexture({ size: [widthPx, heightPx], format: 'rgba16float', usage: GPUTextureUsage.RENDER_ATTACHMENT | GPUTextureUsage.COPY_SRC });
    const bytesPerRow = 256 * Math.ceil(8 * widthPx / 256);
    const read = device.createBuffer({ size: bytesPerRow * heightPx, usage: GPUBufferUsage.COPY_DST | GPUBufferUsage.MAP_READ });
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginRenderPass({ colorAttachments: [{ view: target.createView(), loadOp: 'clear', clearValue: [0, 0, 0, 0], storeOp: 'store' }] });
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, device.createBindGroup({ layout: pipeline.getBindGroupLayout(0), entries: buffers.map((made, binding) => ({ binding, resource: { buffer: made } })) }));
    pass.draw(4, splats.count);
    pass.end();
    encoder.copyTextureToBuffer({ texture: target }, { buffer: read, bytesPerRow }, [widthPx, heightPx]);
    device.queue.submit([encoder.finish()]);
    const error = await device.popErrorScope();
    if (error) throw new Error(error.message);
    await read.mapAsync(GPUMapMode.READ);
    const halves = new Uint16Array(read.getMappedRange());
    const pixels = Float32Array.from({ length: 4 * widthPx * heightPx }, (_, i) => {
        const row = Math.floor(i / (4 * widthPx));
        return DataUtils.fromHalfFloat(halves[row * bytesPerRow / 2 + i % (4 * widthPx)]);
    });
    device.destroy();
    return pixels;
}

/** RGB over the scene's background, rows from the top. */
export async function drawing(job: Drawing): Promise<{ width: number; height: number; rgb: number[] }> {
    const scene = await sceneOf(job);
    const pixels = 'wgsl' in job.listings ? await drawWebGPU(scene, job.listings.wgsl) : drawWebGL(scene, job.listings);
    const { background } = scene.info;
    const rgb = Array.from({ length: 3 * pixels.length / 4 }, (_, i) => {
        const at = 4 * Math.floor(i / 3);
        return pixels[at + i % 3] + (1 - pixels[at + 3]) * background[i % 3];
    });
    return { width: scene.view.widthPx, height: scene.view.heightPx, rgb };
}

Object.assign(window, { drawing, ready: true });
