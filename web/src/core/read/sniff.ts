import { shown } from './errors';

/** First bytes of formats that are not read here, and what to call them. */
const OTHERS: Readonly<Record<string, string>> = {
    'ply\n': 'a PLY file',
    'ply\r': 'a PLY file',
    NGSP: 'an SPZ file',
    '\x1f\x8b': 'a gzip file, as SPZ is',
    '#usda': 'an OpenUSD file (text)',
    'PXR-USDC': 'an OpenUSD file (binary)',
    PK: 'a zip archive, as USDZ is',
    '\x89PNG': 'an image',
    '\xff\xd8\xff': 'an image',
    RIFF: 'an image',
    '<': 'HTML or XML (is the address right?)',
    '{': 'JSON (pack a .gltf as one .glb file)',
};

/** Bytes of a file that {@link nameOf} looks at. */
export const HEAD_BYTES = 64;

/** What a file seems to be, by its first bytes: a description, or the bytes themselves in quotes. */
export function nameOf(head: Uint8Array): string {
    const text = String.fromCharCode(...head);
    // White space and a byte order mark may precede text.
    const start = text.replace(/^(\xef\xbb\xbf)?\s*/, '');
    const magic = Object.keys(OTHERS).find((key) => text.startsWith(key) || start.startsWith(key));
    return magic === undefined ? shown(text.slice(0, 8)) : OTHERS[magic];
}
