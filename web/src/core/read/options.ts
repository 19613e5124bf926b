import type { SceneInfo, Splats, SplatUpdate } from '../scene';
import type { Helpers } from './ltgs/job';

/** How to read a scene. */
export interface ReadOptions {
    /** Called once, before any update. */
    readonly onInfo?: (info: SceneInfo) => void;
    /** Called before any update with the stand-in of a file that has one: a small scene that looks like the whole. It is skipped where this is not given. */
    readonly onStandIn?: (splats: Splats) => void;
    /** Called as splats arrive. Arrays must stay as they are until reading has ended. */
    readonly onUpdate?: (update: SplatUpdate) => void;
    /** Called with a text about a file that is shown, but is not as it should be. */
    readonly onWarning?: (text: string) => void;
    /** Splats that are wanted: the first ones, which contribute most in files with layers. Default: all. */
    readonly maxSplats?: number;
    /** Bytes of the file, if they are known before it has arrived: a small file cannot claim to be large then. */
    readonly fileBytes?: number;
    readonly signal?: AbortSignal;
    /** Whether the hash over all decoded numbers is checked, where all are read. Default: yes. */
    readonly checkHash?: boolean;
}

/** Options that the workers of the package add. */
export interface HelpedOptions extends ReadOptions {
    readonly helpers?: Helpers;
}
