/**
 * xxh3-64 with seed 0, as https://github.com/Cyan4973/xxHash specifies it. Long inputs are hashed in halves of 32 bits; what
 * is done once per input uses BigInt.
 */

const SECRET = Uint8Array.from(
    (
        'b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c' +
        '3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364' +
        'eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e'
    ).match(/../g)!,
    (digits) => parseInt(digits, 16),
);
const SECRET_VIEW = new DataView(SECRET.buffer);
/** The secret as words, and the 16 words for the last stripe. */
const SECRET_WORDS = new Uint32Array(SECRET.buffer);
const LAST_WORDS = new Uint32Array(SECRET.slice(121, 185).buffer);

const BLOCK_BYTES = 1024;
const PRIME32_1 = 0x9e3779b1;
const PRIME64 = [0x9e3779b185ebca87n, 0xc2b2ae3d27d4eb4fn, 0x165667b19e3779f9n, 0x85ebca77c2b2ae63n, 0x27d4eb2f165667c5n];

const low = (x: bigint): bigint => BigInt.asUintN(64, x);

function folded(a: bigint, b: bigint): bigint {
    const product = a * b;
    return low(product) ^ (product >> 64n);
}

function avalanche(h: bigint): bigint {
    h = low((h ^ (h >> 37n)) * 0x165667919e3779f9n);
    return h ^ (h >> 32n);
}

function avalancheOfShort(h: bigint): bigint {
    h = low((h ^ (h >> 33n)) * PRIME64[1]);
    h = low((h ^ (h >> 29n)) * PRIME64[2]);
    return h ^ (h >> 32n);
}

const secretAt = (at: number): bigint => SECRET_VIEW.getBigUint64(at, true);

/** Hash of up to 240 bytes. */
function short(bytes: Uint8Array): bigint {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const count = bytes.length;
    const size = BigInt(count);
    const wordAt = (at: number): bigint => view.getBigUint64(at, true);
    if (count > 16) return ofPairs(count, (at, secret) => folded(wordAt(at) ^ secretAt(secret), wordAt(at + 8) ^ secretAt(secret + 8)));
    if (count > 8) {
        const a = wordAt(0) ^ secretAt(24) ^ secretAt(32);
        const b = wordAt(count - 8) ^ secretAt(40) ^ secretAt(48);
        const swapped = new DataView(new ArrayBuffer(8));
        swapped.setBigUint64(0, a, true);
        return avalanche(low(size + swapped.getBigUint64(0) + b + folded(a, b)));
    }
    if (count > 3) {
        const word = (BigInt(view.getUint32(0, true)) << 32n) + BigInt(view.getUint32(count - 4, true));
        let h = word ^ secretAt(8) ^ secretAt(16);
        const rotated = (by: bigint): bigint => low(h << by) | (h >> (64n - by));
        h ^= rotated(49n) ^ rotated(24n);
        h = low(h * 0x9fb21c651e98df25n);
        h = low((h ^ ((h >> 35n) + size)) * 0x9fb21c651e98df25n);
        return h ^ (h >> 28n);
    }
    if (count === 0) return avalancheOfShort(secretAt(56) ^ secretAt(64));
    const word = (bytes[0] << 16) | (bytes[count >> 1] << 24) | bytes[count - 1] | (count << 8);
    return avalancheOfShort(BigInt(word >>> 0) ^ BigInt((SECRET_WORDS[0] ^ SECRET_WORDS[1]) >>> 0));
}

/** Hash of 17 to 240 bytes from a mix of 16 bytes at one place with the secret at another. */
function ofPairs(count: number, mix: (at: number, secret: number) => bigint): bigint {
    let sum = low(BigInt(count) * PRIME64[0]);
    if (count <= 128) {
        for (let i = (count - 1) >> 5; i >= 0; i -= 1) sum += mix(16 * i, 32 * i) + mix(count - 16 * (i + 1), 32 * i + 16);
        return avalanche(low(sum));
    }
    for (let i = 0; i < 8; i += 1) sum += mix(16 * i, 16 * i);
    sum = avalanche(low(sum));
    for (let i = 8; i < count >> 4; i += 1) sum += mix(16 * i, 16 * (i - 8) + 3);
    return avalanche(low(sum + mix(count - 16, 119)));
}

/** Adds a stripe of 16 words to the accumulators. */
function accumulate(sums: Uint32Array, words: Uint32Array, at: number, secret: Uint32Array, place: number): void {
    for (let i = 0; i < 16; i += 2) {
        const a = words[at + i];
        const b = words[at + i + 1];
        const keyA = (a ^ secret[place + i]) >>> 0;
        const keyB = (b ^ secret[place + i + 1]) >>> 0;
        // The f64 product is off by less than 2^11, so the upper half rounds to the exact one.
        const lower = Math.imul(keyA, keyB) >>> 0;
        const upper = (keyA * keyB - lower) * 2 ** -32 + 0.5;
        const sum = sums[i] + lower;
        sums[i] = sum;
        sums[i + 1] = sums[i + 1] + Math.floor(upper) + (sum > 0xffffffff ? 1 : 0);
        const other = sums[i ^ 2] + a;
        sums[i ^ 2] = other;
        sums[(i ^ 2) + 1] = sums[(i ^ 2) + 1] + b + (other > 0xffffffff ? 1 : 0);
    }
}

function scramble(sums: Uint32Array): void {
    for (let i = 0; i < 16; i += 2) {
        const a = sums[i];
        const b = sums[i + 1];
        const x = (a ^ (b >>> 15) ^ SECRET_WORDS[32 + i]) >>> 0;
        const y = b ^ SECRET_WORDS[33 + i];
        const lower = Math.imul(x, PRIME32_1) >>> 0;
        sums[i] = lower;
        sums[i + 1] = Math.imul(y, PRIME32_1) + Math.floor((x * PRIME32_1 - lower) * 2 ** -32 + 0.5);
    }
}

/** Hashes bytes that come in parts. */
export class Xxh3 {
    private readonly sums = new Uint32Array(16);
    private readonly words = new Uint32Array(BLOCK_BYTES / 4);
    private readonly block = new Uint8Array(this.words.buffer);
    /** The last 64 bytes before the block. */
    private readonly before = new Uint8Array(64);
    private filled = 0;
    private total = 0;

    constructor() {
        const start = [0xc2b2ae3dn, PRIME64[0], PRIME64[1], PRIME64[2], PRIME64[3], 0x85ebca77n, PRIME64[4], BigInt(PRIME32_1)];
        new BigUint64Array(this.sums.buffer).set(start);
    }

    update(bytes: Uint8Array): this {
        this.total += bytes.length;
        for (let at = 0; at < bytes.length; ) {
            // A block is done only when a byte behind it is there, as the last stripe is different.
            if (this.filled === BLOCK_BYTES) this.finishBlock();
            const part = bytes.subarray(at, at + BLOCK_BYTES - this.filled);
            this.block.set(part, this.filled);
            this.filled += part.length;
            at += part.length;
        }
        return this;
    }

    private finishBlock(): void {
        for (let stripe = 0; stripe < 16; stripe += 1) accumulate(this.sums, this.words, 16 * stripe, SECRET_WORDS, 2 * stripe);
        scramble(this.sums);
        this.before.set(this.block.subarray(BLOCK_BYTES - 64));
        this.filled = 0;
    }

    /** The hash; nothing can be added afterwards. */
    digest(): bigint {
        if (this.total <= 240) return short(this.block.subarray(0, this.filled));
        const { sums, filled } = this;
        for (let stripe = 0; stripe < (filled - 1) >> 6; stripe += 1) {
            accumulate(sums, this.words, 16 * stripe, SECRET_WORDS, 2 * stripe);
        }
        const last = new Uint8Array(64);
        const own = this.block.subarray(Math.max(filled - 64, 0), filled);
        last.set(this.before.subarray(own.length));
        last.set(own, 64 - own.length);
        accumulate(sums, new Uint32Array(last.buffer), 0, LAST_WORDS, 0);
        const lanes = new BigUint64Array(sums.buffer);
        let sum = BigInt(this.total) * PRIME64[0];
        for (let i = 0; i < 4; i += 1) sum += folded(lanes[2 * i] ^ secretAt(11 + 16 * i), lanes[2 * i + 1] ^ secretAt(19 + 16 * i));
        return avalanche(low(sum));
    }

    /** The hash as 16 hexadecimal digits. */
    hex(): string {
        return this.digest().toString(16).padStart(16, '0');
    }
}

/** xxh3-64 (seed 0) of bytes, as 16 hexadecimal digits. */
export function xxh3(bytes: Uint8Array): string {
    return new Xxh3().update(bytes).hex();
}
