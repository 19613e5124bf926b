import { Matrix4, type PerspectiveCamera, Vector3 } from 'three';
import type { SceneCamera } from '../core/scene';
import { similarityOf } from '../guest/view';

/**
 * Lets a camera take exactly the place and the lens of a camera of the capture, for an image of its aspect ratio: sets its
 * position, rotation, `fov` and view offset. The camera has no parent, or one without a transform.
 */
export function takeSceneCamera(camera: PerspectiveCamera, { rotation: r, translation: t, focalPx, principalPx, widthPx, heightPx }: SceneCamera, matrixWorld: Matrix4): void {
    const cameraFromData = new Matrix4().set(r[0], r[1], r[2], t[0], -r[3], -r[4], -r[5], -t[1], -r[6], -r[7], -r[8], -t[2], 0, 0, 0, 1);
    const { rotation: m, translation, scale } = similarityOf(matrixWorld.elements);
    const worldFromData = new Matrix4().set(m[0], m[1], m[2], translation[0] / scale, m[3], m[4], m[5], translation[1] / scale, m[6], m[7], m[8], translation[2] / scale, 0, 0, 0, 1);
    worldFromData.multiply(cameraFromData.invert()).decompose(camera.position, camera.quaternion, new Vector3());
    camera.position.multiplyScalar(scale);
    camera.fov = 2 * Math.atan(0.5 * heightPx / focalPx[1]) * 180 / Math.PI;
    camera.zoom = 1;
    // Pixels that are not square widen the image that the offset is measured in.
    const wide = focalPx[1] / focalPx[0];
    camera.setViewOffset(widthPx * wide, heightPx, (0.5 * widthPx - principalPx[0]) * wide, 0.5 * heightPx - principalPx[1], widthPx * wide, heightPx);
    camera.updateMatrixWorld();
}
