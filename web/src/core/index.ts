export * from './scene';
export * from './read';
export { COLOURS, CLASS_COLOURS, CLASS_LABELS, type Colours } from './render/colours';
export { SplatRenderer, type DrawOptions, type RendererOptions } from './render/renderer';
export { Sorter, type SortView } from './render/sort';
export { centreOf, viewOf, type View } from './render/view';
