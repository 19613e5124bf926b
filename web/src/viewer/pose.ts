/** Where the camera of a viewer stands and looks, in the frame of the data, and what moves it. */

import type { SceneCamera, SceneInfo } from '../core/scene';
import { centreOf, type View } from '../core/render/view';
import type { Sphere } from './bounds';
import { add, cross, dot, length, normalize, scale, sub, turned, type Vec3 } from './vector';

/** Closest that the direction of view comes to straight up or down, radians. */
const POLE_MARGIN = 0.02;

/** An image of quite another shape is not enlarged further to cover a viewport: it would show too little, and that blurred. */
const COVER_MAX = 2;

/** Focal lengths and principal point for an image of this size. */
export type Lens = Pick<SceneCamera, 'widthPx' | 'heightPx' | 'focalPx' | 'principalPx'>;

export class Pose {
    /** Axes of the camera: x right, y down, z forward. */
    right: Vec3 = [1, 0, 0];
    down: Vec3 = [0, -1, 0];
    forward: Vec3 = [0, 0, -1];
    centre: Vec3 = [0, 0, 0];
    /** Distance of the point that orbits go around, in front of the camera. */
    distance = 1;
    /** Whether the lens's image fills the viewport, which cuts two of its sides off, instead of lying in it whole. */
    covers = false;
    lens: Lens = { widthPx: 640, heightPx: 480, focalPx: [600, 600], principalPx: [320, 240] };

    constructor(readonly up: Vec3 = [0, 1, 0]) {}

    /** Takes exactly the place, the direction and the lens of a camera of the capture. */
    goTo(camera: SceneCamera): void {
        const r = camera.rotation;
        [this.right, this.down, this.forward] = [0, 3, 6].map((i) => [r[i], r[i + 1], r[i + 2]] as Vec3) as [Vec3, Vec3, Vec3];
        this.centre = centreOf(camera);
        this.lens = camera;
        this.covers = false;
    }

    get target(): Vec3 {
        return add(this.centre, this.forward, this.distance);
    }

    /** Orbits around the target, or turns on the spot: `yaw` to the right, `pitch` down, radians. */
    turn(yaw: number, pitch: number, onTheSpot = false): void {
        const target = this.target;
        const axis = normalize(this.right);
        const height = Math.acos(Math.max(-1, Math.min(1, dot(this.forward, this.up))));
        const limited = Math.max(POLE_MARGIN - height, Math.min(Math.PI - POLE_MARGIN - height, pitch));
        // A pitch down turns the forward axis away from up.
        this.rotate(axis, this.upright() ? -limited : limited);
        this.rotate(this.up, -yaw);
        if (!onTheSpot) this.centre = add(target, this.forward, -this.distance);
    }

    /** Moves along the camera's axes, units of the data. */
    move(right: number, down: number, forward: number): void {
        this.centre = add(add(add(this.centre, this.right, right), this.down, down), this.forward, forward);
    }

    /** Comes closer to the target (`factor` below 1) or goes away. */
    dolly(factor: number): void {
        const target = this.target;
        this.distance *= factor;
        this.centre = add(target, this.forward, -this.distance);
    }

    /** Comes closer, or goes away, and keeps what stands at the target's distance under a pixel of the image where it is. */
    dollyTo([x, y]: readonly [number, number], view: View, factor: number): void {
        const kept = (1 - factor) * this.distance;
        this.dolly(factor);
        this.move(kept * (x - view.principalPx[0]) / view.focalPx[0], kept * (y - view.principalPx[1]) / view.focalPx[1], 0);
    }

    /** Looks at a point from where it stands, with the horizon level. */
    lookAt(point: Vec3): void {
        const offset = sub(point, this.centre);
        this.distance = Math.max(length(offset), 1e-6);
        this.forward = normalize(offset, this.forward);
        this.right = normalize(cross(this.forward, this.up), this.right);
        this.down = cross(this.forward, this.right);
    }

    /** What it sees in a viewport of this size. */
    view(widthPx: number, heightPx: number): View {
        const { lens } = this;
        const { scale: ratio, x, y } = fitted(lens, widthPx, heightPx, this.covers);
        return {
            rotation: [...this.right, ...this.down, ...this.forward],
            translation: [-dot(this.right, this.centre), -dot(this.down, this.centre), -dot(this.forward, this.centre)],
            focalPx: [lens.focalPx[0] * ratio, lens.focalPx[1] * ratio],
            principalPx: [x + lens.principalPx[0] * ratio, y + lens.principalPx[1] * ratio],
            widthPx,
            heightPx,
        };
    }

    private upright(): boolean {
        return dot(this.down, this.up) <= 0;
    }

    private rotate(axis: Vec3, radians: number): void {
        this.right = normalize(turned(this.right, axis, radians));
        this.forward = normalize(turned(this.forward, axis, radians));
        this.down = cross(this.forward, this.right);
    }
}

/** Where an image of `lens` lies in a viewport that shows it whole, or that it covers: its scale and its upper left corner, px. */
export function fitted(lens: Lens, widthPx: number, heightPx: number, covers = false): { scale: number; x: number; y: number } {
    const [across, down] = [widthPx / lens.widthPx, heightPx / lens.heightPx];
    const whole = Math.min(across, down);
    const ratio = covers ? Math.min(Math.max(across, down), COVER_MAX * whole) : whole;
    return { scale: ratio, x: (widthPx - lens.widthPx * ratio) / 2, y: (heightPx - lens.heightPx * ratio) / 2 };
}

/** A pose to begin with: that of the home camera, whose image covers the viewport, orbiting around what all cameras look at. */
export function homePose(info: SceneInfo, bounds: Sphere): Pose {
    const cameras = info.cameras;
    const pose = new Pose(upOf(info));
    if (cameras.length > 0) {
        pose.goTo(homeCamera(info)!);
        pose.covers = true;
        pose.distance = orbitDistance(pose, cameras, bounds);
        return pose;
    }
    // A little from above in the world, whatever the axes of the data.
    const m = info.worldFromData;
    const [x, y, z] = [0, 4, 8].map((i) => dot([m[i], m[i + 1], m[i + 2]], [0.3, 0.25, 1]));
    pose.centre = add(bounds.centre, scale(normalize([x, y, z]), 2.5 * bounds.radius));
    pose.lookAt(bounds.centre);
    return pose;
}

/**
 * Brings a pose back to where photos were taken: within `reach` of a camera's place, in parts of the mean distance of these places
 * from their middle (of the target, if there is one place only).
 */
export function keepNear(pose: Pose, cameras: readonly SceneCamera[], reach: number): void {
    if (cameras.length === 0) return;
    const places = cameras.map(centreOf);
    const middle = scale(places.reduce((sum, place) => add(sum, place), [0, 0, 0]), 1 / places.length);
    const spread = places.reduce((sum, place) => sum + length(sub(place, middle)), 0) / places.length || pose.distance;
    const nearest = places.reduce((best, place) => (length(sub(place, pose.centre)) < length(sub(best, pose.centre)) ? place : best));
    const away = length(sub(pose.centre, nearest)), allowed = reach * spread;
    if (away <= allowed) return;
    const target = pose.target;
    pose.centre = add(nearest, sub(pose.centre, nearest), allowed / away);
    // Closer to the target or farther, so that orbits go on around it.
    pose.distance = Math.max(dot(sub(target, pose.centre), pose.forward), 1e-6);
}

/** The one that the file names, else the first of the training. */
export function homeCamera(info: SceneInfo): SceneCamera | undefined {
    return info.cameras[info.home ?? -1] ?? info.cameras.find((camera) => !camera.heldOut) ?? info.cameras[0];
}

/** Up: y of the world, which the program that wrote the file has stood upright. */
export function upOf(info: SceneInfo): Vec3 {
    const m = info.worldFromData;
    return normalize([m[1], m[5], m[9]]);
}

/** Distance along the axis to the point nearest to all other cameras' axes; to the scene's middle if they do not meet. */
function orbitDistance(pose: Pose, cameras: readonly SceneCamera[], bounds: Sphere): number {
    const distances = cameras.map((camera) => {
        const r = camera.rotation;
        const axis: Vec3 = [r[6], r[7], r[8]];
        const offset = sub(centreOf(camera), pose.centre);
        const c = dot(pose.forward, axis);
        const across = 1 - c * c;
        return across < 0.01 ? NaN : (dot(offset, pose.forward) - dot(offset, axis) * c) / across;
    }).filter((distance) => distance > 0).sort((a, b) => a - b);
    if (distances.length > 0) return distances[distances.length >> 1];
    return Math.max(dot(sub(bounds.centre, pose.centre), pose.forward), 0.5 * bounds.radius, 1e-3);
}
