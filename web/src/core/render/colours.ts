/** What the colour of a splat shows. The numbers stand in the shaders as COLOURS_*. */
export const COLOURS = {
    /** The image as trained. */
    trained: 0,
    /** Without textures: what other viewers can show, maps averaged into the colour. */
    untextured: 1,
    /** Texels along the longer side of the splat's map, in classes. */
    texels: 2,
    /** SH degree. */
    degree: 3,
    /** Distance along the camera's axis, logarithmic; near is bright. */
    depth: 4,
} as const;

export type Colours = keyof typeof COLOURS;

/** Colours of the classes, those of `litetex render --colour-by`: first that of splats without a map or of degree 0. */
export const CLASS_COLOURS: Readonly<Partial<Record<Colours, readonly string[]>>> = {
    texels: ['#56b4e9', '#3b126b', '#6a1b85', '#9a2982', '#c83e70', '#ed5f60', '#ff8f66', '#fdca89', '#fef9ba'],
    degree: ['#56b4e9', '#3b126b', '#dc4d66', '#fef9ba'],
};

/** Labels of the classes. */
export const CLASS_LABELS: Readonly<Partial<Record<Colours, readonly string[]>>> = {
    texels: ['none', '2', '4', '8', '16', '32', '64', '128', '256+'],
    degree: ['0', '1', '2', '3'],
};

/** RGB of nine classes, in [0, 1], as the shader takes them. */
export function classColours(colours: Colours): Float32Array {
    const values = new Float32Array(27);
    (CLASS_COLOURS[colours] ?? []).forEach((hex, i) => {
        for (let c = 0; c < 3; c++) values[3 * i + c] = parseInt(hex.slice(1 + 2 * c, 3 + 2 * c), 16) / 255;
    });
    return values;
}
