import { readFileSync } from 'node:fs';
import { expect, test } from 'vitest';
import { Xxh3, xxh3 } from '../../src/core/read/xxh3';
test('xxh3', () => {
  const v = JSON.parse(readFileSync('/tmp/xx.json', 'utf8'));
  for (const [n, h] of v) {
    const d = Uint8Array.from({ length: n }, (_, i) => (i * 131 + (i >> 8) * 17 + 7) & 255);
    expect([n, xxh3(d)]).toEqual([n, h]);
    const x = new Xxh3();
    for (let at = 0; at < n; at += 37) x.update(d.subarray(at, at + 37));
    expect([n, x.hex()]).toEqual([n, h]);
  }
  const big = new Uint8Array(50e6).map((_, i) => i * 7);
  let t = performance.now(); xxh3(big); console.log('MB/s', 50e3 / (performance.now() - t));
});
