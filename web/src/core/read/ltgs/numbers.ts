import { check } from '../errors';

/**
 * Numbers of codec 2: a binary range coder whose probabilities adapt and are mixed (`ltgs.md`, section 2). Integers only.
 */

/** Probabilities at log odds of -8 to 8 in steps of 1/2. */
const Q = [
    11, 18, 30, 49, 81, 133, 219, 360, 589, 961, 1554, 2486, 3906, 5978, 8813, 12371, 16384, 20397, 23955, 26790, 28862, 30282, 31214,
    31807, 32179, 32408, 32549, 32635, 32687, 32719, 32738, 32750, 32757,
];

const LOG_ODDS_MAX = 2047;
const LEAST = 32;
const MOST = 32736;
const WEIGHT_MAX = 1 << 20;

/** S(d) at d + 2047. */
export const S = Int32Array.from({ length: 2 * LOG_ODDS_MAX + 1 }, (_, i) => {
    const d = i - LOG_ODDS_MAX;
    const a = (d >> 7) + 16;
    const b = d & 127;
    return (Q[a] * (128 - b) + Q[a + 1] * b + 64) >> 7;
});

/** p at d + 2047: S(d) away from 0 and 1. */
const P = Int16Array.from(S, (s) => Math.min(Math.max(s, LEAST), MOST));

/** D(z) at floor(z / 8). */
export const D = new Int16Array(4096);
for (let place = 0, i = 0; place < D.length; place += 1) {
    while (i < S.length - 1 && S[i] < 8 * place + 4) i += 1;
    D[place] = i - LOG_ODDS_MAX;
}

/** Counts only matter up to here: from then on, h is 6. */
const COUNT_MAX = 62;

/** h by count. */
const RATES = Uint8Array.from({ length: COUNT_MAX + 1 }, (_, count) => Math.min(6, 31 - Math.clz32(count + 2)));

/** Nodes of a value of a context: 32 of L, and three for each L from 1. */
const NODES = 128;
const WEIGHTS = 3 * 33;

/** A probability and a count in one number: z * 64 + c. */
const START = 16384 << 6;

/** Reads the numbers of one stream after the other, and keeps its memory for the next. */
export class Numbers {
    /** L of the number read last: the length of u + 1 in bits, less one. */
    length = 0;
    private lengthBefore = 0;
    private data: Uint8Array = new Uint8Array(0);
    private taken = 0;
    private contexts = 1;
    /** range and code. */
    private readonly coder = new Int32Array(2);
    /** What each context has learnt, by value and node. */
    private readonly states = [new Int32Array(12 * NODES), new Int32Array(0), new Int32Array(0)];
    private readonly weights = new Int32Array(WEIGHTS);

    /**
     * Begins a stream of coded bytes. `second` and `third`: how many values its further contexts have; 0 for those that it lacks.
     */
    start(data: Uint8Array, second: number, third: number): void {
        this.data = data;
        this.taken = 4;
        this.length = this.lengthBefore = 0;
        this.contexts = third > 0 ? 3 : second > 0 ? 2 : 1;
        this.coder[0] = -1;
        this.coder[1] = 0;
        for (let i = 0; i < 4; i += 1) this.coder[1] = (this.coder[1] << 8) | (data[i] ?? 0);
        [12, second, third].forEach((values, i) => {
            if (this.states[i].length < NODES * values) this.states[i] = new Int32Array(NODES * values);
            this.states[i].fill(START, 0, NODES * values);
        });
        this.weights.fill(Math.floor(65536 / this.contexts));
    }

    /** Reads a number of up to 32 bits, given the values of its second and third context. */
    next(second = 0, third = 0): number {
        const { data, contexts, coder, weights } = this;
        const [first, other, last] = this.states;
        const a = NODES * Math.min(11, this.length + this.lengthBefore);
        const b = NODES * second;
        const c = NODES * third;
        let range = coder[0];
        let code = coder[1];
        let taken = this.taken;
        let length = -1;
        let value = 1;
        let known = 0;
        let node = 0;
        let weight = 0;
        for (;;) {
            const x = first[a + node];
            let p = x >> 6;
            let y = 0;
            let z = 0;
            let dx = 0;
            let dy = 0;
            let dz = 0;
            if (contexts > 1) {
                y = other[b + node];
                dx = D[x >> 9];
                dy = D[y >> 9];
                // Products have up to 32 bits, so that their sum is taken in halves.
                const u = Math.imul(weights[weight], dx);
                const v = Math.imul(weights[weight + 1], dy);
                let high = (u >> 16) + (v >> 16);
                let low = (u & 0xffff) + (v & 0xffff);
                if (contexts > 2) {
                    z = last[c + node];
                    dz = D[z >> 9];
                    const w = Math.imul(weights[weight + 2], dz);
                    high += w >> 16;
                    low += w & 0xffff;
                }
                const d = high + (low >> 16);
                p = P[d < -LOG_ODDS_MAX ? 0 : d > LOG_ODDS_MAX ? 2 * LOG_ODDS_MAX : d + LOG_ODDS_MAX];
            }
            const bound = Math.imul(range >>> 15, p);
            let bit = 0;
            if (code >>> 0 < bound >>> 0) {
                range = bound;
            } else {
                bit = 1;
                code = (code - bound) | 0;
                range = (range - bound) | 0;
            }
            while (range >>> 24 === 0) {
                range <<= 8;
                code = (code << 8) | (taken < data.length ? data[taken] : 0);
                taken += 1;
            }
            first[a + node] = learnt(x, bit);
            if (contexts > 1) {
                const error = bit === 1 ? -p : 32768 - p;
                other[b + node] = learnt(y, bit);
                weights[weight] = moved(weights[weight], Math.imul(dx, error));
                weights[weight + 1] = moved(weights[weight + 1], Math.imul(dy, error));
                if (contexts > 2) {
                    last[c + node] = learnt(z, bit);
                    weights[weight + 2] = moved(weights[weight + 2], Math.imul(dz, error));
                }
            }
            if (length < 0) {
                if (bit === 1 && node < 31) {
                    node += 1;
                    weight += 3;
                    continue;
                }
                length = node + bit;
                if (length === 0) break;
                node = 29 + 3 * length;
                weight = 3 * 32;
            } else {
                value = 2 * value + bit;
                known += 1;
                if (known === 2 || known === length) break;
                node += 1 + bit;
            }
        }
        for (; known < length; known += 1) {
            const bound = (range >>> 15) << 14;
            value *= 2;
            if (code >>> 0 < bound >>> 0) {
                range = bound;
            } else {
                value += 1;
                code = (code - bound) | 0;
                range = (range - bound) | 0;
            }
            while (range >>> 24 === 0) {
                range <<= 8;
                code = (code << 8) | (taken < data.length ? data[taken] : 0);
                taken += 1;
            }
        }
        if (value > 2 ** 32) check(false, 'number of a stream', value - 1, 'at most 32 bits');
        coder[0] = range;
        coder[1] = code;
        this.taken = taken;
        this.lengthBefore = this.length;
        this.length = length;
        return value - 1;
    }

    /** Checks that the numbers read need all coded bytes, and no more. */
    end(): void {
        const { data, taken } = this;
        const rest = data.length + 4 - taken;
        const isSpent = rest === 0 || (rest > 0 && rest <= 4 && data[data.length - 1] !== 0);
        check(isSpent, 'bytes of a stream of numbers', data.length, `${taken - 4}, and no zeros behind them`);
    }
}

function learnt(state: number, bit: number): number {
    const z = state >> 6;
    const count = state & 63;
    const rate = RATES[count];
    const next = bit === 1 ? z - (z >> rate) : z + ((32768 - z) >> rate);
    return ((next < LEAST ? LEAST : next > MOST ? MOST : next) << 6) | (count < COUNT_MAX ? count + 1 : count);
}

function moved(weight: number, change: number): number {
    const next = weight + (change >> 13);
    return next < -WEIGHT_MAX ? -WEIGHT_MAX : next > WEIGHT_MAX ? WEIGHT_MAX : next;
}
