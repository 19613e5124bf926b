import { decompress } from 'fzstd';
import { invalid } from './errors';

/** Most bytes that a coded byte stands for: 128 KiB from a block of 4 bytes. */
const EXPANSION_MAX = 1 << 15;

export function unpacked(coded: Uint8Array, count: number): Uint8Array {
  if (count > EXPANSION_MAX * (coded.length + 1)) throw invalid(`zstd: ${coded.length} bytes cannot hold ${count}`);
  try {
    return decompress(coded, new Uint8Array(count));
  } catch (error) {
    throw invalid(`zstd: ${String(error)}`);
  }
}
