/** Measures between two points of the surface: clicks, or the middle of the window, while its panel is open. */

import { pick } from '../core/pick';
import { pointAt, rayThrough } from '../viewer/ray';
import type { SplatSurfaces } from '../viewer/surfaces';
import type { Vec3 } from '../viewer/vector';
import type { Viewer } from '../viewer/viewer';
import { distanceOf, placeOf, scaleOption } from './distance';
import { byId, makeSvg } from './dom';

/** A pointer that moves further between down and up drags, px. */
const CLICK_PX = 5;
const WHICH = ['first', 'second'];

export class Measure {
    private on = false;
    /** In the data. */
    private points: Vec3[] = [];
    private surfaces: Promise<SplatSurfaces> | null = null;
    private down: [x: number, y: number] = [0, 0];
    private readonly length = byId<HTMLInputElement>('measure-length');

    constructor(private readonly viewer: Viewer) {
        const { canvas } = viewer;
        canvas.addEventListener('pointerdown', ({ clientX, clientY }) => { this.down = [clientX, clientY]; });
        canvas.addEventListener('click', ({ clientX: x, clientY: y }) => {
            if (this.on && Math.hypot(x - this.down[0], y - this.down[1]) <= CLICK_PX) void this.take([x, y]);
        });
        byId('measure-middle').addEventListener('click', () => void this.take([canvas.clientWidth / 2, canvas.clientHeight / 2]));
        this.length.addEventListener('input', () => this.showOption());
        byId('measure-copy').addEventListener('click', () => void this.copy());
        new ResizeObserver(() => this.draw()).observe(canvas);
    }

    /** Begins, or ends: what was measured is dropped. */
    setOn(on: boolean): void {
        if (on === this.on) return;
        this.on = on;
        document.documentElement.classList.toggle('measuring', on);
        this.viewer.controls.focuses = !on;
        this.clear();
    }

    /** Begins anew, as of another scene. */
    clear(): void {
        this.points = [];
        this.length.value = '';
        this.changed();
        this.update();
    }

    /** To be called when what is shown is another version of the scene: its surface is looked up once more. */
    changed(): void {
        this.surfaces = null;
    }

    /** Brings the marks to where the camera shows the points. */
    draw(): void {
        const { clientWidth: width, clientHeight: height } = this.viewer.canvas;
        const marks = document.getElementById('measure-marks')!;
        marks.toggleAttribute('hidden', !this.on);
        if (!this.on || !this.viewer.pose) return;
        const view = this.viewer.pose.view(width, height);
        const places = this.points.map((point) => placeOf(view, point)).filter((place) => place !== null);
        const [x, y] = [width / 2, height / 2];
        const line = places.length === 2 ? [makeSvg('line', { x1: places[0][0], y1: places[0][1], x2: places[1][0], y2: places[1][1] })] : [];
        const middle = makeSvg('path', { class: 'middle', d: `M${x - 8} ${y}h16M${x} ${y - 8}v16` });
        marks.replaceChildren(middle, ...line, ...places.map(([cx, cy]) => makeSvg('circle', { cx, cy, r: 5 })));
    }

    private async take(at: [x: number, y: number]): Promise<void> {
        const { viewer } = this;
        if (!viewer.pose || !viewer.info) return;
        const ray = rayThrough(viewer.pose.view(viewer.canvas.clientWidth, viewer.canvas.clientHeight), at, viewer.info.near);
        if (this.points.length === 2) {
            this.points = [];
            this.update();
        }
        if (!this.surfaces) this.say('Looking for the surface');
        const surfaces = this.surfaces ??= viewer.surfaces();
        let found;
        try {
            found = pick(await surfaces, ray);
        } catch (error) {
            if (surfaces === this.surfaces) this.surfaces = null;
            return this.say(`${(error as Error).message}. ${this.next()}`);
        }
        // Closed, or another scene, meanwhile.
        if (!this.on || surfaces !== this.surfaces) return;
        if (!found) return this.say(`There is no surface there, only background. ${this.next()}`);
        const point = pointAt(ray, found.distance);
        this.points.push(point);
        this.update();
    }

    private next(): string {
        return `Click on the ${WHICH[this.points.length % 2]} point.`;
    }

    private update(): void {
        const { info } = this.viewer;
        byId('measure-option').hidden = true;
        if (this.points.length === 2 && info) {
            const { distance, unit } = distanceOf(info, this.points as [Vec3, Vec3]);
            this.say(`${distance.toLocaleString('en', { maximumSignificantDigits: 4 })} ${unit}`);
            byId('measure-option').hidden = !info.captureFromData;
            this.showOption();
        } else {
            this.say(this.next());
        }
        this.draw();
    }

    private showOption(): void {
        const { info } = this.viewer;
        byId('measure-copied').textContent = '';
        if (info && this.points.length === 2) byId('measure-command').textContent = scaleOption(info, this.points as [Vec3, Vec3], this.length.value);
    }

    private async copy(): Promise<void> {
        const command = byId('measure-command');
        // Without permission, or in a file where the browser has no clipboard: it is selected, for the user to copy.
        const copied = await navigator.clipboard?.writeText(command.textContent!).then(() => true, () => false);
        if (!copied) getSelection()!.selectAllChildren(command);
        byId('measure-copied').textContent = copied ? 'Copied' : 'Selected: copy it by hand';
    }

    private say(text: string): void {
        byId('measure-text').textContent = text;
    }
}
