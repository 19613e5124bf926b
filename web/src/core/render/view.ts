import type { SceneCamera } from '../scene';

/** A pinhole camera and the image it takes. Axes: x right, y down, z forward. */
export interface View {
    /** Rotation of camera_from_data, row by row. */
    readonly rotation: readonly number[];
    /** Translation of camera_from_data, units of the data. */
    readonly translation: readonly [number, number, number];
    /** Focal lengths along x and y. */
    readonly focalPx: readonly [number, number];
    readonly principalPx: readonly [number, number];
    readonly widthPx: number;
    readonly heightPx: number;
}

/** What a camera of the capture sees in an image of another size: each axis by its own ratio. */
export function viewOf(camera: SceneCamera, widthPx = camera.widthPx, heightPx = camera.heightPx): View {
    const ratio = [widthPx / camera.widthPx, heightPx / camera.heightPx];
    return {
        rotation: camera.rotation,
        translation: camera.translation,
        focalPx: [camera.focalPx[0] * ratio[0], camera.focalPx[1] * ratio[1]],
        principalPx: [camera.principalPx[0] * ratio[0], camera.principalPx[1] * ratio[1]],
        widthPx,
        heightPx,
    };
}

/** Where the camera stands, in the data: -R^T t. */
export function centreOf({ rotation: r, translation: t }: Pick<View, 'rotation' | 'translation'>): [number, number, number] {
    return [0, 1, 2].map((c) => -(r[c] * t[0] + r[3 + c] * t[1] + r[6 + c] * t[2])) as [number, number, number];
}
