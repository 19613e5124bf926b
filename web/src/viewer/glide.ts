/** Motion that goes on a little after the hand has stopped: what is asked for is done over some images, most of it at once. */

import type { View } from '../core/render/view';
import type { Pose } from './pose';

/** Two thirds are done in this time. Longer feels like lag, less like none. */
const GLIDE_SECS = 0.07;
/** What nobody sees: radians, parts of the distance. */
const REST = 1e-4;

export class Glide {
    private yaw = 0;
    private pitch = 0;
    private right = 0;
    private down = 0;
    /** Logarithm of a factor of the distance, and the place of the view that it keeps. */
    private zoom = 0;
    private place: { at: readonly [number, number]; view: View } | null = null;

    get isMoving(): boolean {
        return Math.max(...[this.yaw, this.pitch, this.right, this.down, this.zoom].map(Math.abs)) > 0;
    }

    turn(yaw: number, pitch: number): void {
        this.yaw += yaw;
        this.pitch += pitch;
    }

    /** Parts of the distance to the target. */
    shift(right: number, down: number): void {
        this.right += right;
        this.down += down;
    }

    /** `at`: the place of a view, px, that stays where it is. */
    dolly(factor: number, at: readonly [number, number], view: View): void {
        this.zoom += Math.log(factor);
        this.place = { at, view };
    }

    stop(): void {
        this.yaw = this.pitch = this.right = this.down = this.zoom = 0;
    }

    /** Does what is due after this many seconds; all of it for those who prefer less motion. */
    advance(pose: Pose, secs: number, onTheSpot: boolean, atOnce: boolean): void {
        const rest = Math.max(...[this.yaw, this.pitch, this.right, this.down, this.zoom].map(Math.abs));
        const part = atOnce || rest < REST ? 1 : 1 - Math.exp(-secs / GLIDE_SECS);
        const take = (value: number) => part * value;
        if (this.yaw || this.pitch) pose.turn(take(this.yaw), take(this.pitch), onTheSpot);
        if (this.right || this.down) pose.move(take(this.right) * pose.distance, take(this.down) * pose.distance, 0);
        if (this.zoom) pose.dollyTo(this.place!.at, this.place!.view, Math.exp(take(this.zoom)));
        this.yaw -= take(this.yaw);
        this.pitch -= take(this.pitch);
        this.right -= take(this.right);
        this.down -= take(this.down);
        this.zoom -= take(this.zoom);
    }
}
