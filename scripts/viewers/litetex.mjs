// Our own package, built into the folder LITETEX_WEB. Options are those of its `draw`: `colours: "untextured"` for the splats that other
// programs show, `precision`, `onCanvas`.
import { openScene, SplatRenderer, viewOf } from '/litetex/core.js';
import { pixels } from '/png.mjs';

export async function render(job) {
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [job.camera.width, job.camera.height];
    const renderer = new SplatRenderer(canvas);
    await openScene({ url: job.url }, (info) => renderer.start(info), (update) => renderer.apply(update)).done;
    const view = viewOf(renderer.info.cameras[renderer.info.home], canvas.width, canvas.height);
    const options = { ...job.options, background: [0, 0, 0] };
    await renderer.sorted(view);
    renderer.draw(view, options);
    const image = pixels(canvas);
    const [c, s] = [Math.cos(0.01), Math.sin(0.01)];
    const r = view.rotation, t = view.translation;
    const other = {
        ...view,
        rotation: r.map((v, i) => (i < 3 ? c * v - s * r[i + 6] : i >= 6 ? c * v + s * r[i - 6] : v)),
        translation: [c * t[0] - s * t[2], t[1], c * t[2] + s * t[0]],
    };
    const { gl } = renderer;
    const draw = (i) => {
        renderer.draw(i % 2 ? other : view, options);
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    };
    return { ...image, draw, figures: renderer.figures };
}
