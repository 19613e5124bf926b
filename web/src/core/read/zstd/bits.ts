import { bitsAt } from '../bytes';
import { check } from '../errors';

/** Refuses a frame that cannot be. */
export function expect(holds: boolean): asserts holds {
    check(holds, 'zstd', 'damaged data', 'a frame as in RFC 8878');
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

    /** The next bits, up to 31, without reading them; zeros before the first one. */
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
