import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { D, Numbers, S } from '../../src/core/read/ltgs/numbers';
import { xxh3 } from '../../src/core/read/xxh3';

interface Stream {
  name: string;
  bytes?: string;
  bytesXxh3: string;
  contexts: number[][] | number;
  count: number;
  numbers?: number[];
  numbersXxh3: string;
}

const pack = JSON.parse(readFileSync(new URL('../../../samples/conformance/coder.json', import.meta.url), 'utf8'));
test('x', () => {
  for (const s of pack.streams as Stream[]) {
    if (s.name === 'generated') continue;
    const data = Uint8Array.from(s.bytes!.match(/../g) ?? [], (d) => parseInt(d, 16));
    const n = new Numbers();
    const ctx = s.contexts as number[][];
    if (s.count === 0) continue;
    n.start(data, ctx[0] ? 4096 : 0, ctx[1] ? 4096 : 0);
    const found = s.numbers!.map((_, i) => n.next(ctx[0]?.[i], ctx[1]?.[i]));
    n.end();
    expect(found).toEqual(s.numbers);
  }
  expect([xxh3(new Uint8Array(Uint16Array.from(S).buffer)), xxh3(new Uint8Array(Int16Array.from(D).buffer))]).toEqual(Object.values(pack.tables).reverse());
});
