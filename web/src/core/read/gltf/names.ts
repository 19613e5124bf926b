/** Khronos' extension for splats, and ours, which is nested in it. */
export const KHR = 'KHR_gaussian_splatting';
export const EXTENSION = 'LITETEX_gaussian_splatting_texture';
