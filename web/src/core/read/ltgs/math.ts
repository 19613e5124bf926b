/** Powers and logarithms of two from + - * / alone, so that every machine gets the same bits (`ltgs.md`, section 4). */

export const LN_2 = 0.6931471805599453;
export const Y_00 = 0.28209479177387814;

/** Smallest and largest positive normal f32. */
export const F32_MIN = 2 ** -126;
export const F32_MAX = 3.4028234663852886e38;

const F64 = new Float64Array(1);
const HALVES = new Int32Array(F64.buffer);

/** 2^n, for -1022 <= n <= 1023. */
export function twoTo(n: number): number {
    HALVES[0] = 0;
    HALVES[1] = (n + 1023) << 20;
    return F64[0];
}

/** floor(log2 x) of a positive normal number. */
export function floorLog2(x: number): number {
    F64[0] = x;
    return ((HALVES[1] >>> 20) & 0x7ff) - 1023;
}

/** log2 x of a positive normal number in units of 1/256, rounded down. */
export function log256(x: number): number {
    const whole = floorLog2(x);
    let y = x / twoTo(whole);
    let f = 0;
    for (let i = 0; i < 8; i += 1) {
        y *= y;
        f *= 2;
        if (y >= 2) {
            y /= 2;
            f += 1;
        }
    }
    return 256 * whole + f;
}

export function exp2(x: number): number {
    const clamped = clamp(x, -1000, 1000);
    const whole = Math.floor(clamped + 0.5);
    const y = (clamped - whole) * LN_2;
    let s = 1;
    for (let n = 15; n > 0; n -= 1) s = 1 + (s * y) / n;
    return s * twoTo(whole);
}

export function clamp(x: number, least: number, most: number): number {
    return x < least ? least : x > most ? most : x;
}

/** R of section 4.1: the nearest integer, clamped to +-2^30. */
export function nearest(y: number): number {
    return clamp(Math.floor(y + 0.5), -1073741824, 1073741824);
}

/** The number that a signed one is stored as: 0, 1, 2, 3, ... are 0, -1, 1, -2, ... */
export function signed(u: number): number {
    return (u >>> 1) ^ -(u & 1);
}

/** len of section 4.3: floor(log2(u + 1)). */
export function lengthOf(u: number): number {
    return u === 0xffffffff ? 32 : 31 - Math.clz32(u + 1);
}
