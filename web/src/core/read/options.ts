import type { SceneInfo, SplatUpdate } from '../scene';

/** What readers of all formats can be told. */
export interface ReaderOptions {
  /** Called once, before any update. */
  readonly onInfo?: (info: SceneInfo) => void;
  /** Called as splats arrive. */
  readonly onUpdate?: (update: SplatUpdate) => void;
  /** Called with a text about a file that is shown, but is not as it should be. */
  readonly onWarning?: (text: string) => void;
  /** Splats that are wanted: the first ones, which contribute most in files with layers. Default: all. */
  readonly maxSplats?: number;
  /** Whether the hash over all decoded numbers is checked, where all are read. Default: yes. */
  readonly checkHash?: boolean;
}
