// PNGs of pixels, and matrices that all programs need.

/** `{width, height, data}` with 4 bytes a pixel, rows from the top, as the base64 of an opaque PNG. */
export async function png({ width, height, data }) {
    const image = new ImageData(width, height);
    image.data.set(data);
    for (let i = 3; i < image.data.length; i += 4) image.data[i] = 255;
    const canvas = new OffscreenCanvas(width, height);
    canvas.getContext('2d').putImageData(image, 0, 0);
    const bytes = new Uint8Array(await (await canvas.convertToBlob({ type: 'image/png' })).arrayBuffer());
    let text = '';
    for (const byte of bytes) text += String.fromCharCode(byte);
    return btoa(text);
}

/** The pixels of a canvas that keeps its drawing buffer. */
export function pixels(canvas) {
    const flat = new OffscreenCanvas(canvas.width, canvas.height);
    const context = flat.getContext('2d');
    context.drawImage(canvas, 0, 0);
    return { width: canvas.width, height: canvas.height, data: context.getImageData(0, 0, canvas.width, canvas.height).data };
}

/** A projection, column-major, with depths from -1 (WebGL) or 0 (WebGPU) to 1. */
export function projection({ window: { left, right, bottom, top }, near }, from = -1) {
    const far = 1e4 * near;
    const [a, b] = from === 0 ? [far / (near - far), near * far / (near - far)] : [(near + far) / (near - far), 2 * near * far / (near - far)];
    return [
        2 / (right - left), 0, 0, 0,
        0, 2 / (top - bottom), 0, 0,
        (right + left) / (right - left), (top + bottom) / (top - bottom), a, -1,
        0, 0, b, 0,
    ];
}

/** Lets frames pass, for programs that sort in a worker. */
export async function frames(count, draw) {
    for (let i = 0; i < count; i++) {
        draw?.();
        await new Promise((resolve) => setTimeout(resolve, 60));
    }
}

/** A camera's matrix, column-major, turned around its own vertical axis. */
export function turned(m, radians) {
    const [c, s] = [Math.cos(radians), Math.sin(radians)];
    return m.map((v, i) => (i < 4 ? c * v - s * m[i + 8] : i >= 8 && i < 12 ? c * v + s * m[i - 8] : v));
}
