/**
 * A scene as readers give it and renderers take it.
 *
 * Numbers are in the data frame of `gltf.md`, section 4: right-handed, y up. Readers of `.ltgs` files, whose numbers
 * have y down, turn them, which changes signs only.
 */

/** Splats, one after the other in every array. */
export interface Splats {
  readonly count: number;
  /** x, y, z of each centre. */
  readonly positions: Float32Array;
  /** Unit quaternions x, y, z, w: data from surfel. */
  readonly rotations: Float32Array;
  /** Standard deviations along u and v. */
  readonly scales: Float32Array;
  /** In (0, 1]. */
  readonly opacities: Float32Array;
  /** SH degree of each splat, 0 to 3. */
  readonly shDegrees: Uint8Array;
  /** SH coefficients: for each splat the (degree + 1)^2 of its own degree, RGB each. Degree 0 is the exact one. */
  readonly sh: Float32Array;
  /** Rows and columns of each map; both 0 without a map. */
  readonly rows: Uint16Array;
  readonly cols: Uint16Array;
  /** Texel sizes along u and v; 0 without a map. */
  readonly texelSizes: Float32Array;
  /** Shifts of the map along u and v, half texels. */
  readonly shifts: Int16Array;
  /** RGB of each texel, in [-1, 1]: map by map in the order of splats, each row by row. */
  readonly texels: Float32Array;
}

type Vector = readonly [number, number, number];

/** A camera of the capture: x right, y down, z forward. */
export interface SceneCamera {
  readonly name: string;
  readonly widthPx: number;
  readonly heightPx: number;
  /** Focal lengths along x and y. */
  readonly focalPx: readonly [number, number];
  readonly principalPx: readonly [number, number];
  /** Rotation of camera_from_data, row by row. */
  readonly rotation: readonly number[];
  /** Translation of camera_from_data. */
  readonly translation: readonly [number, number, number];
  /** Kept out of the training. */
  readonly heldOut: boolean;
}

/** Texts; empty if not known. */
export interface Provenance {
  readonly title: string;
  readonly author: string;
  readonly licence: string;
  readonly source: string;
  /** The direction of the capture that is up in the file, and why. */
  readonly up: string;
  readonly programVersion: string;
  /** Begins with `metres` if a unit of the world is one, and says how that is known; `unknown scale`; empty if the file does not say. */
  readonly scale: string;
  readonly training: Readonly<Record<string, string>>;
}

/** What a file says besides its splats. */
export interface SceneInfo {
  readonly container: 'ltgs' | 'gltf';
  readonly quality: string;
  /** Splats and texels of the whole file. */
  readonly splats: number;
  readonly texels: number;
  /** Largest SH degree of a splat. */
  readonly shDegree: number;
  /** Near plane, units of the data. */
  readonly near: number;
  readonly filter: 'none' | 'ewa';
  readonly background: readonly [number, number, number];
  readonly colourSpace: 'srgb_rec709_display' | 'lin_rec709_display';
  /** World (y up) from data: a similarity, column by column. */
  readonly worldFromData: readonly number[];
  /** The frame of the capture, that of its poses, from data: a similarity, column by column; null: not known. */
  readonly captureFromData: readonly number[] | null;
  readonly cameras: readonly SceneCamera[];
  /** Index of the camera to begin at; null: none is named. */
  readonly home: number | null;
  /** Box around the bulk of what is seen, without floaters and backdrop; null: not known. */
  readonly bounds: { readonly min: Vector; readonly max: Vector } | null;
  readonly provenance: Provenance;
  /** Whether the textures are missing: dropped by another program, or of a newer version. Says why. */
  readonly untextured: string | null;
  /** Bytes of the file with which the scene looks better than its stand-in; null: it has none. */
  readonly standInUntil: number | null;
  readonly fileBytes: number;
}

/** Splats that have arrived: they replace all splats of the scene from `first` on. */
export interface SplatUpdate {
  readonly first: number;
  readonly splats: Splats;
  /** Bytes of the file that were read for it. */
  readonly bytes: number;
  /**
   * False if texels or view-dependent colours of some of these splats are still to come. A later update brings them, from
   * the first splat that lacked them on: who skips an incomplete update loses splats.
   */
  readonly complete: boolean;
}

/** A file that cannot be shown: `message` says what was found and what was expected. */
export class SceneError extends Error {
  /** `invalid`: the file is damaged. `unsupported`: it is of another kind or of a newer version. */
  readonly kind: 'invalid' | 'unsupported';

  constructor(kind: 'invalid' | 'unsupported', message: string) {
    super(message);
    this.name = 'SceneError';
    this.kind = kind;
  }
}
