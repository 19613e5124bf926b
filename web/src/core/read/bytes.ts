/** A view for reading little-endian numbers. */
export function viewOf(bytes: Uint8Array): DataView {
    return new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
}

/** A u64, rounded above 2^53: all bounds on such numbers are lower. */
export function u64At(view: DataView, at: number): number {
    return view.getUint32(at, true) + view.getUint32(at + 4, true) * 2 ** 32;
}

/** Up to 31 bits of bytes from a bit on, the lowest bit first; zeros behind the end. */
export function bitsAt(bytes: Uint8Array, at: number, count: number): number {
    const place = at >> 3;
    const shift = at & 7;
    const word = bytes[place] | (bytes[place + 1] << 8) | (bytes[place + 2] << 16) | (bytes[place + 3] << 24);
    const above = shift > 0 ? bytes[place + 4] << (32 - shift) : 0;
    return ((word >>> shift) | above) & ((1 << count) - 1);
}

/** A 64-bit number as 16 hexadecimal digits. */
export function hex64(value: bigint): string {
    return value.toString(16).padStart(16, '0');
}
