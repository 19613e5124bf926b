export { LitetexGLTFExtension } from './gltf';
export { LitetexLoader } from './loader';
export { LitetexSplats, type SplatIntersection, type TargetColours } from './splats';
export type { SplatsOptions } from '../guest/data';
export type { Colours } from '../core/render/colours';
export { type SceneCamera, SceneError, type SceneInfo, type SplatUpdate } from '../core/scene';
