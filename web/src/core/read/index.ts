import type { SceneInfo } from '../scene';
import { unsupported } from './errors';
import { GlbReader } from './gltf/reader';
import { LtgsReader } from './ltgs/reader';
import type { ReaderOptions } from './options';
import { formatOf } from './sniff';

export { SceneSplats, concatenate } from './splats';
export type { ReaderOptions } from './options';

export interface ReadOptions extends ReaderOptions {
  /** Bytes of the file, if they are known before it has arrived. */
  readonly fileBytes?: number;
  readonly signal?: AbortSignal;
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
  let reader: LtgsReader | GlbReader | null = null;
  let turn = performance.now();
  for await (const piece of pieces) {
    signal?.throwIfAborted();
    if (reader === null) {
      const format = formatOf(piece);
      if (typeof format !== 'string') throw unsupported(`this is ${format.other}; supported: .ltgs and .glb`);
      reader = format === 'ltgs' ? new LtgsReader(options) : new GlbReader(options);
    }
    reader.push(piece);
    while (await reader.step()) {
      if (performance.now() - turn > TURN_MS) {
        await new Promise((resolve) => setTimeout(resolve));
        signal?.throwIfAborted();
        turn = performance.now();
      }
    }
    reader.show();
    if (reader.isDone) break;
  }
  if (reader === null) throw unsupported('the file is empty');
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
