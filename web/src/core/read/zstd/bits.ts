import { check } from '../errors';

/** Refuses a frame that cannot be. */
export function expect(holds: boolean): asserts holds {
  check(holds, 'zstd', 'damaged data', 'a frame as in RFC 8878');
}

/** Up to 25 bits of bytes from a bit on, the lowest bit first; zeros behind the end. */
export function bitsAt(bytes: Uint8Array, at: number, count: number): number {
  const place = at >> 3;
  const word = bytes[place] | (bytes[place + 1] << 8) | (bytes[place + 2] << 16) | (bytes[place + 3] << 24);
  return (word >>> (at & 7)) & ((1 << count) - 1);
}

/** Bits that are read from the last one on, which a 1 above them marks (RFC 8878, section 4.1). */
export class BackwardBits {
  /** Bits left. Negative: more have been read than there were. */
  left: number;

  constructor(private readonly bytes: Uint8Array) {
    const last = bytes[bytes.length - 1];
    expect(last > 0);
    this.left = 8 * bytes.length - 1 - Math.clz32(last << 24);
  }

  /** The next bits, up to 25, without reading them; zeros before the first one. */
  peek(count: number): number {
    const at = this.left - count;
    return at >= 0 ? bitsAt(this.bytes, at, count) : at > -count ? bitsAt(this.bytes, 0, this.left) << -at : 0;
  }

  read(count: number): number {
    const value = this.peek(count);
    this.left -= count;
    return value;
  }
}
