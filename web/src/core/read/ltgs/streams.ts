import { invalid, unsupported } from '../errors';
import { unpacked } from '../zstd';
import { signed } from './math';
import { Numbers } from './numbers';

/** Codecs of streams: bytes as they are, bytes in a zstd frame, numbers. */
const STORED = 0;
const ZSTD = 1;
const NUMBERS = 2;

/** Most numbers that a byte can hold, rounded up. */
const NUMBERS_PER_BYTE = 8192;

/** One reader for all streams of numbers, which are read one after the other. */
const numbers = new Numbers();

/** The streams of a block, one after the other (`ltgs.md`, section 2). */
export class Block {
  private at = 0;

  constructor(private readonly data: Uint8Array) {}

  /** Checks that nothing follows. */
  end(): void {
    const rest = this.data.length - this.at;
    if (rest > 0) throw invalid(`block: ${rest} bytes behind its streams`);
  }

  /** The bytes of a stream of exactly `count`. */
  bytes(count: number): Uint8Array {
    const { codec, coded } = this.stream(count, false);
    if (codec === ZSTD) return count === 0 ? coded : unpacked(coded, count);
    if (codec !== STORED) throw otherCodec(codec);
    if (coded.length !== count) throw invalid(`stream: ${coded.length} bytes, expected ${count}`);
    return coded;
  }

  /**
   * Begins a stream of `count` numbers, which the caller must all read before it calls `end`; null for one without. `second`
   * and `third`: see {@link Numbers.start}. `orNone`: whether the stream may be without numbers.
   */
  numbers(count: number, second: number, third: number, orNone = false): Numbers | null {
    const { codec, coded, found } = this.stream(count, orNone);
    if (codec !== NUMBERS) throw otherCodec(codec);
    if (found === 0) return null;
    if (count > NUMBERS_PER_BYTE * (coded.length + 1)) throw invalid(`stream: ${coded.length} bytes cannot hold ${count} numbers`);
    numbers.start(coded, second, third);
    return numbers;
  }

  /** Reads signed numbers whose second context is `contexts[i]`, below `values`, or that have none. */
  signed(count: number, contexts?: ArrayLike<number>, values = 0, orNone = false): Int32Array {
    const stream = this.numbers(count, values, 0, orNone);
    const out = new Int32Array(count);
    if (stream === null) return out;
    for (let i = 0; i < count; i += 1) out[i] = signed(stream.next(contexts === undefined ? 0 : contexts[i]));
    stream.end();
    return out;
  }

  /** Reads unsigned numbers in the same way. */
  unsigned(count: number, contexts?: ArrayLike<number>, values = 0): Uint32Array {
    const stream = this.numbers(count, values, 0);
    const out = new Uint32Array(count);
    if (stream === null) return out;
    for (let i = 0; i < count; i += 1) out[i] = stream.next(contexts === undefined ? 0 : contexts[i]);
    stream.end();
    return out;
  }

  private stream(count: number, orNone: boolean): { codec: number; found: number; coded: Uint8Array } {
    const codec = this.byte();
    if (codec > NUMBERS) throw otherCodec(codec);
    const found = this.varint();
    const size = this.varint();
    if (found !== count && !(orNone && found === 0)) {
      throw invalid(`stream: ${found} values, expected ${count}${orNone ? ' or none' : ''}`);
    }
    if (found === 0 && size > 0) throw invalid(`stream: ${size} bytes without values`);
    if (size > this.data.length - this.at) throw invalid(`stream: ${size} bytes, but its block has ${this.data.length - this.at} left`);
    this.at += size;
    return { codec, found, coded: this.data.subarray(this.at - size, this.at) };
  }

  private byte(): number {
    if (this.at >= this.data.length) throw invalid('stream: its block ends before it');
    this.at += 1;
    return this.data[this.at - 1];
  }

  private varint(): number {
    let value = 0;
    for (let scale = 1; scale < 2 ** 64; scale *= 128) {
      const byte = this.byte();
      value += (byte & 127) * scale;
      if (byte < 128) {
        if (value >= 2 ** 64) break;
        return value;
      }
    }
    throw invalid('stream: a count of more than 64 bits');
  }
}

function otherCodec(codec: number): Error {
  return unsupported(`stream: codec ${codec}; supported: 0 and 1 for bytes, 2 for numbers`);
}
