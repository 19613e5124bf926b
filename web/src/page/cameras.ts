/** The cameras of the capture: a list, and steps from one to the next. */

import type { SceneCamera, SceneInfo } from '../core/scene';
import { centreOf } from '../core/render/view';
import { homeCamera, type Pose } from '../viewer/pose';
import type { Viewer } from '../viewer/viewer';
import { byId, make } from './dom';
import { count } from './format';

/** Whether a pose is exactly that of a camera, but for what rounding makes of it. */
export function isAt(pose: Pose, camera: SceneCamera): boolean {
    const axes = [...pose.right, ...pose.down, ...pose.forward];
    const centre = centreOf(camera);
    return pose.lens.focalPx.every((focal, i) => focal === camera.focalPx[i])
        && axes.every((a, i) => Math.abs(a - camera.rotation[i]) < 1e-6)
        && pose.centre.every((c, i) => Math.abs(c - centre[i]) <= 1e-6 * pose.distance);
}

export class Cameras {
    /** The camera last gone to, and whether the view is still exactly its own. */
    current: SceneCamera | null = null;
    exact = false;
    private cameras: readonly SceneCamera[] = [];
    private buttons: HTMLButtonElement[] = [];

    /** `changed` is called when the camera is another, or is left; `way` names what leads back to it. */
    constructor(private readonly viewer: Viewer, private readonly changed: () => void, private readonly way: () => string) {
        byId('camera-previous').addEventListener('click', () => this.step(-1));
        byId('camera-next').addEventListener('click', () => this.step(1));
        byId('camera-name').addEventListener('click', () => this.back());
    }

    /** Lists the cameras of a scene. The current one stays if the scene still has it. */
    show(info: SceneInfo): void {
        const before = this.cameras;
        this.cameras = info.cameras;
        const name = this.current?.name;
        this.current = info.cameras.find((camera) => camera.name === name) ?? homeCamera(info) ?? null;
        // Another version of the same scene: its list stays as it is scrolled, and keeps the focus.
        const same = before.length === info.cameras.length && before.every((b, i) => b.name === info.cameras[i].name && b.heldOut === info.cameras[i].heldOut);
        if (!same) this.fillList();
        const heldOut = info.cameras.filter((camera) => camera.heldOut).length;
        byId('cameras-note').textContent = info.cameras.length === 0 ? 'This file names no cameras.'
            : `${count(info.cameras.length)} ${info.cameras.length === 1 ? 'camera' : 'cameras'} of the capture${heldOut ? `; ${count(heldOut)} held out of the training` : ''}.`;
        byId('camera-bar').hidden = info.cameras.length === 0;
        this.update();
    }

    /** Goes back to where it began. */
    home(): void {
        const { info } = this.viewer;
        if (!info) return;
        this.viewer.home();
        this.current = homeCamera(info) ?? null;
        this.update();
    }

    /** Takes exactly the view of a camera. */
    go(camera: SceneCamera): void {
        this.current = camera;
        this.viewer.goTo(camera);
        this.update();
        this.reveal();
    }

    /** Takes the view of the camera of this name, if there is one. */
    goNamed(name: string | null): void {
        const camera = this.cameras.find((candidate) => candidate.name === name);
        if (camera) this.go(camera);
    }

    /** Returns to the camera last gone to. */
    back(): void {
        if (this.current) this.go(this.current);
    }

    /** Goes to the next camera, or the previous. */
    step(by: 1 | -1): void {
        const { length } = this.cameras;
        if (length === 0) return;
        const at = this.current ? this.cameras.indexOf(this.current) : -1;
        this.go(this.cameras[(at + by + length) % length]);
    }

    /** To be called when the view has changed. */
    moved(): void {
        const exact = this.isExact();
        if (exact !== this.exact) this.update();
    }

    /** Scrolls to the current camera of the list. */
    reveal(): void {
        this.buttons[this.cameras.indexOf(this.current!)]?.scrollIntoView({ block: 'nearest' });
    }

    private fillList(): void {
        this.buttons = this.cameras.map((camera, i) => {
            const button = make('button', { type: 'button' }, make('span', {}, camera.name), ...heldOutMark(camera));
            button.addEventListener('click', () => this.go(this.cameras[i]));
            return button;
        });
        byId('cameras').replaceChildren(...this.buttons.map((button) => make('li', {}, button)));
    }

    private isExact(): boolean {
        const { pose } = this.viewer;
        return Boolean(pose && this.current && isAt(pose, this.current) && this.viewer.isWhole);
    }

    private update(): void {
        this.exact = this.isExact();
        const { current } = this;
        this.buttons.forEach((button, i) => {
            if (this.cameras[i] === current) button.setAttribute('aria-current', 'true');
            else button.removeAttribute('aria-current');
        });
        byId('camera-bar').classList.toggle('away', !this.exact);
        if (current) {
            byId('camera-name').replaceChildren(
                make('span', {}, current.name), ...heldOutMark(current), ...(this.exact ? [] : [make('span', { className: 'back' }, this.way())]),
            );
        }
        this.changed();
    }
}

function heldOutMark(camera: SceneCamera): HTMLElement[] {
    return camera.heldOut ? [make('span', { className: 'held-out', title: 'Held out of the training' }, 'held out')] : [];
}
