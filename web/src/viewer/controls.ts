/** Mouse, touch and keys that move a pose. */

import type { View } from '../core/render/view';
import { Glide } from './glide';
import { reducedMotion } from './motion';
import type { Pose } from './pose';

export type Mode = 'orbit' | 'fly';

const RADIANS_PER_PX = 0.005;
const DOLLY_PER_PX = 0.0015;
/** Part of the distance to the target that keys move per second. */
const FLY_PER_SEC = 0.6;
const TURN_PER_SEC = 0.9;
/** A pointer that moves further between down and up drags. */
const CLICK_PX = 5;
/** Two clicks within this time are one double click. */
const DOUBLE_MS = 400;
/** A key that is tapped moves as if it were held for this long. */
const TAP_SECS = 1 / 60;

const MOVES: Record<string, readonly [right: number, down: number, forward: number]> = {
    KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, -1, 0], KeyQ: [0, 1, 0],
};
const TURNS: Record<string, readonly [yaw: number, pitch: number]> = {
    ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1],
};

export class Controls {
    mode: Mode = 'orbit';
    enabled = true;
    zoom = true;
    /** Whether a double click or tap focuses. */
    focuses = true;
    private readonly pointers = new Map<number, { x: number; y: number }>();
    private readonly pressed = new Set<string>();
    /** The last click or tap, and where its pointer went down. */
    private clicked = { at: -Infinity, x: 0, y: 0 };
    private downAt = [0, 0];
    private readonly glide = new Glide();
    private readonly stop = new AbortController();

    /**
     * `pose` gives the one to move; `moved` is called after every change, `focus` with a place that was clicked or tapped twice, CSS px
     * of the surface. Keys are taken from `keys`, which may be the window or
     * an element around the surface: letters wherever the focus is, but in a field; arrows, which others need, of the surface only.
     */
    constructor(private readonly surface: HTMLElement, private readonly pose: () => Pose | null, private readonly moved: () => void, private readonly focus: (x: number, y: number) => void, keys: EventTarget) {
        const signal = this.stop.signal;
        surface.style.touchAction = 'none';
        surface.addEventListener('pointerdown', (event) => this.down(event), { signal });
        surface.addEventListener('pointermove', (event) => this.drag(event), { signal });
        surface.addEventListener('pointerup', (event) => this.click(event), { signal });
        for (const name of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
            surface.addEventListener(name, (event) => this.pointers.delete(event.pointerId), { signal });
        }
        surface.addEventListener('wheel', (event) => this.wheel(event), { signal, passive: false });
        surface.addEventListener('contextmenu', (event) => event.preventDefault(), { signal });
        keys.addEventListener('keydown', (event) => this.press(event as KeyboardEvent), { signal });
        keys.addEventListener('keyup', (event) => this.release(event as KeyboardEvent), { signal });
        // Keys are released elsewhere then.
        keys.addEventListener(keys === window ? 'blur' : 'focusout', () => this.pressed.clear(), { signal });
    }

    dispose(): void {
        this.stop.abort();
    }

    /** Of an element that leaves the document nobody tells when keys and pointers are released. */
    letGo(): void {
        this.pressed.clear();
        this.pointers.clear();
        this.glide.stop();
    }

    /** Ends motion that goes on by itself, as when the camera is put elsewhere. */
    halt(): void {
        this.glide.stop();
    }

    /** Whether keys or pointers are held, or the camera still glides. */
    get active(): boolean {
        return this.pressed.size > 0 || this.pointers.size > 0 || this.glide.isMoving;
    }

    /** Moves by the keys held for this many seconds, and glides on. Returns whether the pose changed. */
    advance(secs: number): boolean {
        const pose = this.pose();
        if (!pose || !this.enabled || (this.pressed.size === 0 && !this.glide.isMoving)) return false;
        for (const code of this.pressed) this.step(pose, code, secs);
        this.glide.advance(pose, secs, this.mode === 'fly', Boolean(reducedMotion?.matches));
        return true;
    }

    private step(pose: Pose, code: string, secs: number): void {
        const move = MOVES[code], turn = TURNS[code], step = FLY_PER_SEC * pose.distance * secs;
        if (move) pose.move(step * move[0], step * move[1], step * move[2]);
        if (turn) pose.turn(TURN_PER_SEC * secs * turn[0], TURN_PER_SEC * secs * turn[1], this.mode === 'fly');
    }

    private down(event: PointerEvent): void {
        if (!this.enabled) return;
        this.surface.focus({ preventScroll: true });
        this.surface.setPointerCapture(event.pointerId);
        this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        this.downAt = [event.clientX, event.clientY];
    }

    /** A second click or tap at the place of the first focuses. Not all browsers tell of double taps. */
    private click({ clientX: x, clientY: y, timeStamp, button }: PointerEvent): void {
        const [startX, startY] = this.downAt, before = this.clicked;
        const isClick = button === 0 && this.pointers.size === 1 && Math.hypot(x - startX, y - startY) <= CLICK_PX;
        this.clicked = isClick ? { at: timeStamp, x, y } : { ...before, at: -Infinity };
        if (!isClick || timeStamp - before.at > DOUBLE_MS || Math.hypot(x - before.x, y - before.y) > 4 * CLICK_PX) return;
        this.clicked.at = -Infinity;
        const { left, top } = this.surface.getBoundingClientRect();
        if (this.enabled && this.focuses) this.focus(x - left, y - top);
    }

    private drag(event: PointerEvent): void {
        const [pose, last] = [this.pose(), this.pointers.get(event.pointerId)];
        if (!pose || !last || !this.enabled) return;
        if (!event.buttons) return void this.pointers.delete(event.pointerId); // let go where nobody was told
        const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
        const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
        if (others.length > 0) {
            // Two fingers: what they span scales the distance, their middle shifts the scene.
            const before = Math.hypot(last.x - others[0].x, last.y - others[0].y);
            const after = Math.hypot(event.clientX - others[0].x, event.clientY - others[0].y);
            const middle = { clientX: (event.clientX + others[0].x) / 2, clientY: (event.clientY + others[0].y) / 2 };
            if (this.zoom && before > 0 && after > 0) this.glide.dolly(before / after, ...this.placeOf(pose, middle));
            this.pan(pose, dx / 2, dy / 2);
        } else if (event.buttons & 6 || event.shiftKey) {
            this.pan(pose, dx, dy);
        } else {
            // In orbit the scene follows the pointer; in flight the view is dragged along.
            const sign = this.mode === 'fly' ? -1 : 1;
            this.glide.turn(sign * dx * RADIANS_PER_PX, sign * dy * RADIANS_PER_PX);
        }
        this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
        this.moved();
    }

    /** The point in the middle of the image follows the pointer. */
    private pan(pose: Pose, dx: number, dy: number): void {
        const { clientWidth, clientHeight } = this.surface;
        const view = pose.view(clientWidth, clientHeight);
        this.glide.shift(-dx / view.focalPx[0], -dy / view.focalPx[1]);
    }

    /** Where the pointer is in the image, CSS px, and the view of that. */
    private placeOf(pose: Pose, { clientX, clientY }: { clientX: number; clientY: number }): [at: [number, number], view: View] {
        const { left, top, width, height } = this.surface.getBoundingClientRect();
        return [[clientX - left, clientY - top], pose.view(width, height)];
    }

    private wheel(event: WheelEvent): void {
        const pose = this.pose();
        if (!pose || !this.enabled || !this.zoom) return;
        event.preventDefault();
        const px = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : 33 * event.deltaY;
        if (this.mode === 'fly') pose.move(0, 0, -px * DOLLY_PER_PX * pose.distance);
        else this.glide.dolly(Math.exp(px * DOLLY_PER_PX), ...this.placeOf(pose, event));
        this.moved();
    }

    private press(event: KeyboardEvent): void {
        const { code } = event;
        if (!this.enabled || event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
        const target = event.composedPath()[0] as Element;
        const isOurs = target === this.surface || target === document.body;
        if (!(isOurs && code in TURNS) && !(code in MOVES && (isOurs || !needsLetters(target)))) return;
        event.preventDefault();
        const pose = this.pose();
        // At once: a tap may be over before the next image.
        if (pose && !this.pressed.has(code)) this.step(pose, code, TAP_SECS);
        this.pressed.add(code);
        this.moved();
    }

    private release({ code }: KeyboardEvent): void {
        if (this.pressed.delete(code)) this.moved();
    }
}

/** Inputs that letters do nothing in. */
const WITHOUT_LETTERS = ['button', 'checkbox', 'color', 'file', 'image', 'radio', 'range', 'reset', 'submit'];

/** Whether someone types there, or is to answer a dialog first. */
export function needsLetters(element: Element): boolean {
    if (element instanceof HTMLInputElement) return !WITHOUT_LETTERS.includes(element.type);
    return Boolean((element as HTMLElement).isContentEditable || element.closest?.('textarea, select, dialog[open]'));
}
