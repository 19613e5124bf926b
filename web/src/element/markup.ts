/**
 * What JSX and templates may give a `<litetex-viewer>`: the tables from which the types for React, Preact and Vue follow. Types only.
 */

import type { Colours } from '../core/render/colours';
import type { Precision } from '../viewer/pace';

/** An attribute that is on or off. `false` is off in every framework: some remove the attribute, others write "false". */
type Switch = boolean | '' | 'true' | 'false';

type NumberOrText = number | `${number}`;

/** Attributes. */
export interface ViewerAttributes {
    /** Address of a `.ltgs` or `.glb` file. */
    src: string;
    /** What the scene shows, for those who cannot see it. */
    alt: string;
    /** Mouse, touch and keys move the camera. */
    'camera-controls': Switch;
    /** Default: `orbit`. */
    'controls-mode': 'orbit' | 'fly';
    /** Wheel and pinch are left to the page. */
    'disable-zoom': Switch;
    /** Turns around the scene until someone takes hold of it. */
    'auto-rotate': Switch;
    /** Degrees; default 12. */
    'rotation-per-second': NumberOrText;
    /** Name of the camera to begin at. Default: the home view. */
    view: string;
    /** Keeps the camera where photos were taken: within this part of their cameras' spread of one of them; without a number 0.3. */
    'keep-near': NumberOrText | Switch;
    /** Default: `scene`, that of the file. */
    background: 'scene' | 'transparent' | `#${string}`;
    /** Default: `trained`. */
    colours: Colours;
    /** Shows at most this many, those that contribute most. */
    'max-splats': NumberOrText;
    /** Default: `auto`. */
    precision: Precision;
    /** Default: `eager`. */
    loading: 'eager' | 'lazy';
}

/** Events. */
export interface ViewerEvents {
    load: Event;
    progress: ProgressEvent;
    error: ErrorEvent;
    'camera-change': Event;
}

export type Optional<T> = { [Name in keyof T]?: T[Name] | undefined };

/** Handlers as React and Preact take them for elements such as this one: `onload`, `oncamera-change`. */
export type ViewerHandlers = Optional<{ [Name in keyof ViewerEvents as `on${Name}`]: (event: ViewerEvents[Name]) => void }>;
