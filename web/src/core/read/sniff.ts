import { quoted } from './errors';

/** First bytes of formats that are not read here, and what to call them. */
const OTHERS: readonly (readonly [start: string, name: string])[] = [
  ['ply\n', 'a PLY file'],
  ['ply\r', 'a PLY file'],
  ['NGSP', 'an SPZ file'],
  ['\x1f\x8b', 'a gzip file, as SPZ is'],
  ['#usda', 'an OpenUSD file (text)'],
  ['PXR-USDC', 'an OpenUSD file (binary)'],
  ['PK\x03\x04', 'a zip archive, as USDZ is'],
  ['PK\x05\x06', 'an empty zip archive'],
  ['\x89PNG', 'a PNG image'],
  ['\xff\xd8\xff', 'a JPEG image'],
  ['RIFF', 'a RIFF file, as WebP is'],
  ['<', 'HTML or XML: is the address of the file right?'],
  ['{', 'JSON, perhaps a .gltf: pack it as one .glb file'],
];

/** Bytes of a file that {@link formatOf} looks at. */
export const HEAD_BYTES = 512;

/** The format of a file, by its first bytes; a text says what else it is. */
export function formatOf(head: Uint8Array): 'ltgs' | 'glb' | { readonly other: string } {
  const text = String.fromCharCode(...head.subarray(0, HEAD_BYTES));
  if (text.startsWith('LTGS')) return 'ltgs';
  if (text.startsWith('glTF')) return 'glb';
  if (text === '') return { other: 'an empty file' };
  const start = text.replace(/^(\xef\xbb\xbf)?\s*/, '');
  const found = OTHERS.find(([magic]) => text.startsWith(magic) || start.startsWith(magic));
  return { other: found?.[1] ?? `no known format: it begins with ${quoted(text.slice(0, 8))}` };
}
