/**
 * Draws scenes of textured splats with WebGL2, without other libraries. Files are read by `litetex/read`, or in the
 * worker of `openScene`.
 */

export * from './scene';
export { COLOURS, CLASS_COLOURS, CLASS_LABELS, type Colours } from './render/colours';
export { SplatRenderer, type DrawOptions, type RendererOptions } from './render/renderer';
export { Sorter, type SortView } from './render/sort';
export { centreOf, viewOf, type View } from './render/view';
export { openScene, type Opened } from './open';
