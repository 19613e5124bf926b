import type { SceneInfo, SplatUpdate } from '../scene';
import { unsupported } from './errors';
import { LtgsReader } from './ltgs/reader';
import { formatOf } from './sniff';

export { SceneSplats, concatenate } from './splats';
export { LtgsReader } from './ltgs/reader';

export interface ReadOptions {
  /** Called once, before any update. */
  readonly onInfo?: (info: SceneInfo) => void;
  /** Called as splats arrive. The arrays are the caller's. */
  readonly onUpdate?: (update: SplatUpdate) => void;
  /** Splats that are wanted: the first ones, which contribute most in files with layers. Default: all. */
  readonly maxSplats?: number;
  /** Bytes of the file, if they are known before it has arrived. */
  readonly fileBytes?: number;
  readonly signal?: AbortSignal;
  /** Whether the hash over all decoded numbers is checked, where all are read. Default: yes. */
  readonly checkHash?: boolean;
}

/** Milliseconds of work after which others get their turn. */
const TURN_MS = 12;

/**
 * Reads a `.ltgs` file (`exporters/schema/ltgs.md`) or a `.glb` file of splats (`exporters/schema/gltf.md`).
 *
 * Rejects with SceneError for a file that is damaged or of another kind, and with the reason of `signal` if that is aborted.
 * Updates that came before an error can be shown.
 */
export async function readScene(source: ArrayBuffer | Uint8Array | ReadableStream<Uint8Array>, options: ReadOptions = {}): Promise<SceneInfo> {
  const { signal } = options;
  const pieces = piecesOf(source);
  const reader = new LtgsReader(options);
  let turn = performance.now();
  let isKnown = false;
  for await (const piece of pieces) {
    signal?.throwIfAborted();
    if (!isKnown) {
      const format = formatOf(piece);
      isKnown = true;
      if (typeof format !== 'string') throw unsupported(`this is ${format.other}; supported: .ltgs and .glb`);
    }
    reader.push(piece);
    while (reader.step()) {
      if (performance.now() - turn > TURN_MS) {
        await new Promise((resolve) => setTimeout(resolve));
        signal?.throwIfAborted();
        turn = performance.now();
      }
    }
    reader.show();
    if (reader.isDone) break;
  }
  reader.end();
  return reader.info!;
}

async function* piecesOf(source: ArrayBuffer | Uint8Array | ReadableStream<Uint8Array>): AsyncGenerator<Uint8Array> {
  if (!(source instanceof ReadableStream)) {
    yield source instanceof Uint8Array ? source : new Uint8Array(source);
    return;
  }
  const reader = source.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      yield value;
    }
  } finally {
    await reader.cancel();
  }
}
