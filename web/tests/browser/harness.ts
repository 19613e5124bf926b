/** Draws files in the browser and hands the images to the tests. */

import { readFrom } from '../../src/core/worker/read-from';
import type { RendererOptions, DrawOptions } from '../../src/core/render/renderer';
import { SplatRenderer } from '../../src/core/render/renderer';
import { readScene } from '../../src/core/read';
import { viewOf } from '../../src/core/render/view';
import type { Splats, SplatUpdate } from '../../src/core/scene';

export interface Job {
    url: string;
    view: string;
    renderer: RendererOptions;
    draw?: DrawOptions;
    /** Damages on purpose, for negative controls. */
    control?: Control;
}

export interface Drawn {
    width: number;
    height: number;
    /** Premultiplied RGBA of the target, f32, rows from the top. */
    floats: string;
    /** RGBA of the canvas, 8 bits, rows from the bottom. */
    bytes: string;
    linear: boolean;
    figures: SplatRenderer['figures'];
}

export type Control = 'order' | 'mirrored' | 'srgb-texels' | 'clamped-edges' | 'half-pixel';

/** Reads the file, and draws the view once all splats are there and sorted. */
export async function draw(job: Job): Promise<Drawn> {
    const canvas = document.createElement('canvas');
    const renderer = new SplatRenderer(canvas, job.renderer);
    let failure = '';
    await readFrom({ url: job.url }, Infinity, (message) => {
        // Room for the padded maps of a control.
        if (message.kind === 'info') renderer.start({ ...message.info, texels: 2 * message.info.texels + 64 * message.info.splats });
        if (message.kind === 'standIn') renderer.setStandIn(message.splats);
        if (message.kind === 'update') renderer.apply(damaged(message.update, job.control));
        if (message.kind === 'failed') failure = message.message;
    });
    if (failure) throw new Error(failure);
    const camera = renderer.info!.cameras.find(({ name }) => name === job.view || name.replace(/\.\w+$/, '') === job.view);
    if (!camera) throw new Error(`no camera ${job.view}`);
    let view = viewOf(camera);
    if (job.control === 'mirrored') view = { ...view, rotation: view.rotation.map((r, i) => (i < 3 ? -r : r)), translation: [-view.translation[0], view.translation[1], view.translation[2]] };
    if (job.control === 'half-pixel') view = { ...view, principalPx: [view.principalPx[0] + 0.5, view.principalPx[1]] };
    [canvas.width, canvas.height] = [view.widthPx, view.heightPx];
    const reverse = job.control === 'order' ? { ...view, rotation: view.rotation.map((r, i) => (i < 6 ? r : -r)) } : view;
    await renderer.sorted(reverse);
    if (job.control === 'order') Reflect.set(renderer, 'order', { request() {}, dispose() {} });
    renderer.draw(view, job.draw);
    const floats = job.renderer.target === 'canvas' || job.draw?.onCanvas ? new Float32Array(0) : renderer.read();
    const pixels = new Uint8Array(4 * view.widthPx * view.heightPx);
    renderer.gl.bindFramebuffer(renderer.gl.FRAMEBUFFER, null);
    renderer.gl.readPixels(0, 0, view.widthPx, view.heightPx, renderer.gl.RGBA, renderer.gl.UNSIGNED_BYTE, pixels);
    const error = renderer.gl.getError();
    if (error) throw new Error(`WebGL error ${error}`);
    const figures = renderer.figures, linear = renderer.info!.colourSpace === 'lin_rec709_display';
    renderer.dispose();
    return { width: view.widthPx, height: view.heightPx, floats: base64(floats), bytes: base64(pixels), linear, figures };
}

function damaged(update: SplatUpdate, control?: Control): SplatUpdate {
    const { splats } = update;
    if (control === 'srgb-texels') {
        // As a texture declared to hold sRGB would be decoded.
        const decode = (t: number) => { const c = (t + 1) / 2; return 2 * (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4) - 1; };
        return { ...update, splats: { ...splats, texels: splats.texels.map(decode) } };
    }
    if (control === 'clamped-edges') return { ...update, splats: padded(splats) };
    return update;
}

/** Maps with a border that repeats their outermost texels, as clamped texture coordinates would show. */
function padded(splats: Splats): Splats {
    const texels: number[] = [];
    let first = 0;
    for (let i = 0; i < splats.count; i++) {
        const [rows, cols] = [splats.rows[i], splats.cols[i]];
        for (let row = 0; rows > 0 && row < rows + 2; row++) {
            for (let col = 0; col < cols + 2; col++) {
                const inside = (k: number, side: number) => Math.min(side - 1, Math.max(0, k - 1));
                const at = first + inside(row, rows) * cols + inside(col, cols);
                texels.push(...splats.texels.subarray(3 * at, 3 * at + 3));
            }
        }
        first += rows * cols;
    }
    const wider = (side: number) => (side > 0 ? side + 2 : 0);
    return { ...splats, rows: splats.rows.map(wider), cols: splats.cols.map(wider), texels: new Float32Array(texels) };
}

function base64(array: Float32Array | Uint8Array): string {
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    let text = '';
    for (let i = 0; i < bytes.length; i += 0x8000) text += String.fromCharCode(...bytes.subarray(i, i + 0x8000));
    return btoa(text);
}

/** PSNR of what is shown after each part of a file has arrived, against the whole file; dB, in one view. */
export async function prefixes(url: string, view: string, parts: readonly number[], withStandIn = true): Promise<number[]> {
    const bytes = new Uint8Array(await (await fetch(url)).arrayBuffer());
    const images: Float32Array[] = [];
    for (const part of [...parts, 1]) {
        const canvas = document.createElement('canvas');
        const renderer = new SplatRenderer(canvas, { target: 'rgba32f', storage: 'full' });
        let seen = false;
        const apply = (update: SplatUpdate) => { renderer.apply(update); seen = true; };
        const onStandIn = (splats: Splats) => { renderer.setStandIn(splats); seen = true; };
        await readScene(bytes.slice(0, Math.round(part * bytes.length)), { onInfo: (info) => renderer.start(info), ...(withStandIn ? { onStandIn } : {}), onUpdate: apply, fileBytes: bytes.length })
            .catch(() => {}); // cut off
        if (renderer.info && seen) {
            const camera = renderer.info.cameras.find(({ name }) => name.startsWith(view))!;
            const at = viewOf(camera);
            [canvas.width, canvas.height] = [at.widthPx, at.heightPx];
            await renderer.sorted(at);
            renderer.draw(at);
            images.push(renderer.read());
        } else images.push(new Float32Array(0));
        renderer.dispose();
    }
    const whole = images.pop()!;
    const clamped = (v: number) => Math.min(1, Math.max(0, v));
    return images.map((image) => image.length === 0 ? 0 : -10 * Math.log10(image.reduce((sum, v, i) => sum + (i % 4 === 3 ? 0 : (clamped(v) - clamped(whole[i])) ** 2), 0) / (0.75 * whole.length)));
}

/** Fragments that are shaded, and those that are blended, in one view. */
export async function counts(url: string, view: string): Promise<{ shaded: number; blended: number }> {
    const count = async (defines: string) => {
        const canvas = document.createElement('canvas');
        const renderer = new SplatRenderer(canvas, { target: 'rgba32f', defines });
        await readFrom({ url }, Infinity, (message) => {
            if (message.kind === 'info') renderer.start(message.info);
            if (message.kind === 'update') renderer.apply(message.update);
        });
        const at = viewOf(renderer.info!.cameras.find(({ name }) => name.startsWith(view))!);
        [canvas.width, canvas.height] = [at.widthPx, at.heightPx];
        await renderer.sorted(at);
        renderer.draw(at, { background: [0, 0, 0] });
        const sum = renderer.read().reduce((total, v, k) => total + (k % 4 === 0 ? v : 0), 0);
        renderer.dispose();
        return sum;
    };
    return { shaded: await count('#define COUNT_FRAGMENTS\n'), blended: await count('#define COUNT_DRAWN\n') };
}

const harness = { draw, prefixes, counts };
/** What the page offers to tests. */
export type Harness = typeof harness;
Object.assign(window, harness, { ready: true });
