/** Draws scenes in PlayCanvas. */

export { loadSplats } from './load';
export { LitetexSplats, type LitetexSplatsOptions } from './splats';
export type { Colours } from '../core/render/colours';
export { type SceneCamera, SceneError, type SceneInfo, type SplatUpdate } from '../core/scene';
