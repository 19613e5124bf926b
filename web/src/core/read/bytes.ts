/** Bytes as a text of UTF-8; null if they are not. */
export function utf8Of(bytes: Uint8Array): string | null {
  try {
    return new TextDecoder('utf-8', { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    return null;
  }
}

/** A view for reading little-endian numbers. */
export function viewOf(bytes: Uint8Array): DataView {
  return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A u64, rounded above 2^53: all bounds on such numbers are lower. */
export function u64At(view: DataView, at: number): number {
  return view.getUint32(at, true) + view.getUint32(at + 4, true) * 2 ** 32;
}

/** A u64 as 16 hexadecimal digits. */
export function hexAt(view: DataView, at: number): string {
  return view.getBigUint64(at, true).toString(16).padStart(16, '0');
}

/**
 * Bytes that arrive in pieces and are taken in order. Memory follows what has arrived, never what is asked for.
 */
export class ByteQueue {
  private pieces: Uint8Array[] = [];
  /** Bytes that have been taken. */
  taken = 0;
  /** Bytes that have arrived and have not been taken. */
  waiting = 0;

  push(bytes: Uint8Array): void {
    if (bytes.length > 0) {
      this.pieces.push(bytes);
      this.waiting += bytes.length;
    }
  }

  /** The next bytes, without a copy if they arrived together; null if some are still to come. */
  take(count: number): Uint8Array | null {
    if (count > this.waiting) return null;
    const first = this.pieces[0];
    if (first === undefined || first.length >= count) {
      this.drop(count);
      return first?.subarray(0, count) ?? new Uint8Array(0);
    }
    const all = new Uint8Array(count);
    for (let at = 0; at < count; ) {
      const part = this.pieces[0].subarray(0, count - at);
      all.set(part, at);
      at += part.length;
      this.drop(part.length);
    }
    return all;
  }

  /** Takes bytes that nobody needs, as far as they are there; returns whether all were. */
  skip(count: number): boolean {
    const there = Math.min(count, this.waiting);
    this.drop(there);
    return there === count;
  }

  private drop(count: number): void {
    this.taken += count;
    this.waiting -= count;
    let whole = 0;
    while (count > 0) {
      const piece = this.pieces[whole];
      if (piece.length > count) {
        this.pieces[whole] = piece.subarray(count);
        break;
      }
      count -= piece.length;
      whole += 1;
    }
    if (whole > 0) this.pieces.splice(0, whole);
  }
}
