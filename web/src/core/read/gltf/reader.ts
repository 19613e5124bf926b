import type { SceneInfo, SplatUpdate, Splats } from '../../scene';
import { ByteQueue, utf8Of, viewOf } from '../bytes';
import { checkSplats } from '../check';
import { invalid, quoted, unsupported } from '../errors';
import { contentHash } from '../hash';
import { type Json, objectOf, parseJson, textOf } from '../json';
import { checkMemory } from '../limits';
import { LtgsReader } from '../ltgs/reader';
import type { ReaderOptions } from '../options';
import { shWidth, sliced } from '../splats';
import { readAttributes } from './attributes';
import { Document, F32, U8, numbersAt } from './document';
import { findMaps, ownArray, readMaps } from './maps';
import { type Found, findScene, ownMeta } from './scene';

const HEADER_BYTES = 12;
const CHUNK_HEADER_BYTES = 8;
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

/** Most bytes of JSON: 16 MiB of metadata, and room for the rest. */
const JSON_BYTES_MAX = 17 * 2 ** 20;

const MIME_LTGS = 'application/vnd.litetex.ltgs';

/** Reads a `.glb` file of splats while it arrives (`exporters/schema/gltf.md`). Used as {@link LtgsReader}. */
export class GlbReader {
  info: SceneInfo | null = null;
  isDone = false;
  private readonly bytes = new ByteQueue();
  private fileBytes = 0;
  private document: Document | null = null;
  private found: Found | null = null;
  private binBytes = 0;
  /** An embedded `.ltgs` file, and where it lies in the file. */
  private stream: { readonly reader: LtgsReader; readonly first: number; readonly end: number } | null = null;

  constructor(private readonly options: ReaderOptions = {}) {}

  push(bytes: Uint8Array): void {
    this.bytes.push(bytes);
  }

  /** Does a part of the work; false if bytes are missing for the next one, or nothing is left. */
  async step(): Promise<boolean> {
    if (this.isDone) return false;
    if (this.document === null) return this.readJson();
    if (this.stream !== null) return this.readStream(this.stream);
    const bin = this.bytes.take(this.binBytes);
    if (bin === null) return false;
    await this.readArrays(this.document, this.found!, bin);
    this.isDone = true;
    return true;
  }

  show(): void {
    this.stream?.reader.show();
  }

  /** The file has ended; see {@link LtgsReader.end}. */
  end(): void {
    const found = this.bytes.taken + this.bytes.waiting;
    if (this.stream !== null) this.stream.reader.end();
    if (!this.isDone) throw invalid(`truncated: ${found} bytes${this.fileBytes > 0 ? `, the header says ${this.fileBytes}` : ''}`);
  }

  private peeked: DataView | null = null;

  /** The header of the file, the JSON, and the header of the binary chunk. */
  private readJson(): boolean {
    if (this.peeked === null) {
      const head = this.bytes.take(HEADER_BYTES + CHUNK_HEADER_BYTES);
      if (head === null) return false;
      this.peeked = viewOf(head);
      const version = this.peeked.getUint32(4, true);
      if (version !== 2) throw unsupported(`GLB of version ${version}, supported: 2`);
      this.fileBytes = this.peeked.getUint32(8, true);
      if (this.peeked.getUint32(16, true) !== JSON_CHUNK) throw invalid('the first chunk of the GLB file is not JSON');
    }
    const size = this.peeked.getUint32(12, true);
    if (size > JSON_BYTES_MAX) throw unsupported(`${size} bytes of JSON, at most ${JSON_BYTES_MAX}`);
    const rest = this.fileBytes - HEADER_BYTES - CHUNK_HEADER_BYTES - size;
    if (rest < 0) throw invalid(`JSON of ${size} bytes in a file of ${this.fileBytes}`);
    const hasBin = rest >= CHUNK_HEADER_BYTES;
    const bytes = this.bytes.take(size + (hasBin ? CHUNK_HEADER_BYTES : 0));
    if (bytes === null) return false;
    if (hasBin) {
      const view = viewOf(bytes.subarray(size));
      if (view.getUint32(4, true) === BIN_CHUNK) this.binBytes = view.getUint32(0, true);
      if (this.binBytes > rest - CHUNK_HEADER_BYTES) throw invalid(`a binary chunk of ${this.binBytes} bytes in a file of ${this.fileBytes}`);
    }
    this.document = new Document(parseJson(utf8Of(bytes.subarray(0, size)), 'JSON of the file'), this.binBytes);
    this.found = findScene(this.document);
    this.openStream(this.document, this.found);
    return true;
  }

  /** Prepares the reader of an embedded file, if there is one (section 3a). */
  private openStream(document: Document, found: Found): void {
    const { ours } = found;
    if (ours?.stream === undefined) return;
    const beside = ['rects', 'pages', 'texelSize', 'shift', 'shDegree', 'sh0', 'atlas', 'decode', 'meta'].find((name) => ours[name] !== undefined);
    if (beside !== undefined) throw invalid(`${beside} beside stream`);
    const stream = objectOf(ours.stream, 'stream');
    if (stream.mimeType !== MIME_LTGS) throw unsupported(`stream: ${quoted(stream.mimeType)}, supported: ${MIME_LTGS}`);
    const { offset, bytes } = document.view(stream.bufferView, 'stream');
    const first = this.bytes.taken + offset;
    const onInfo = (info: SceneInfo): void => {
      this.info = this.infoOfStream(info, reader, found, ours);
      this.options.onInfo?.(this.info);
    };
    const reader = new LtgsReader({ ...this.options, onInfo });
    this.stream = { reader, first, end: first + bytes };
  }

  private infoOfStream(info: SceneInfo, reader: LtgsReader, found: Found, ours: Json): SceneInfo {
    const check = (name: string, inside: unknown, stated: unknown): void => {
      if (inside !== stated) throw invalid(`stream: ${name} ${quoted(inside)}, the extension says ${quoted(stated)}`);
    };
    check('splats', info.splats, found.attributes.count);
    check('quality', info.quality, ours.quality);
    check('hash', reader.hash, textOf(ours.hash, 'hash').toLowerCase());
    check('colour space', info.colourSpace, found.colourSpace);
    return { ...info, container: 'gltf', worldFromData: found.worldFromData ?? info.worldFromData, fileBytes: this.fileBytes };
  }

  private readStream({ reader, first, end }: { reader: LtgsReader; first: number; end: number }): boolean {
    if (reader.step()) return true;
    if (reader.isDone) {
      this.isDone = true;
      return false;
    }
    if (!this.bytes.skip(Math.max(first - this.bytes.taken, 0))) return false;
    const count = Math.min(end - this.bytes.taken, this.bytes.waiting);
    reader.push(this.bytes.take(count)!);
    return count > 0;
  }

  private async readArrays(document: Document, found: Found, bin: Uint8Array): Promise<void> {
    const { attributes, ours } = found;
    const places = ours === null ? null : findMaps(document, ours, attributes.count);
    const meta = ownMeta(found);
    const checked = (texels: number): void => checkMemory(attributes.count, texels, attributes.degree, this.fileBytes);
    checked(0);
    let splats = readAttributes(bin, attributes, found.isOurs);
    if (!splats.sh.every(Number.isFinite)) throw invalid('SH coefficients that are not finite');
    if (ours !== null) splats = withOwnSh(document, bin, ours, splats, attributes.degree);
    if (ours !== null && places !== null) splats = { ...splats, ...(await readMaps(document, bin, ours, places, checked)) };
    checkSplats(splats);
    this.info = {
      container: 'gltf',
      quality: ours === null ? '' : textOf(ours.quality, 'quality'),
      splats: splats.count,
      texels: splats.texels.length / 3,
      shDegree: attributes.degree,
      ...meta,
      untextured: found.untextured,
      fileBytes: this.fileBytes,
    };
    this.options.onInfo?.(this.info);
    const { maxSplats = Infinity } = this.options;
    const update: SplatUpdate = { first: 0, splats: sliced(splats, 0, Math.min(splats.count, maxSplats)), bytes: this.bytes.taken, complete: true };
    this.options.onUpdate?.(update);
    if (ours !== null && this.options.checkHash !== false && contentHash([splats], meta) !== textOf(ours.hash, 'hash').toLowerCase()) {
      this.options.onWarning?.('the content does not match its hash: a program has changed values');
    }
  }
}

/** Splats with exact SH of degree 0, and each of its own degree. */
function withOwnSh(document: Document, bin: Uint8Array, ours: Json, splats: Splats, degree: number): Splats {
  const { count } = splats;
  const width = shWidth(degree);
  if (ours.sh0 !== undefined) {
    const exact = numbersAt(bin, ownArray(document, ours.sh0, 'sh0', 3, [F32], count));
    for (let i = 0; i < count; i += 1) for (let c = 0; c < 3; c += 1) splats.sh[width * i + c] = exact[3 * i + c];
  }
  if (ours.shDegree === undefined) return splats;
  const shDegrees = Uint8Array.from(numbersAt(bin, ownArray(document, ours.shDegree, 'shDegree', 1, [U8], count)));
  const most = shDegrees.reduce((a, b) => Math.max(a, b), 0);
  if (most !== degree) throw invalid(`SH degrees up to ${most}, the attributes have ${degree}`);
  const sh = new Float32Array(shDegrees.reduce((sum, own) => sum + shWidth(own), 0));
  for (let i = 0, at = 0; i < count; i += 1) {
    const own = shWidth(shDegrees[i]);
    sh.set(splats.sh.subarray(width * i, width * i + own), at);
    if (splats.sh.subarray(width * i + own, width * (i + 1)).some((c) => c !== 0)) throw invalid(`splat ${i}: SH coefficients above its degree of ${shDegrees[i]}`);
    at += own;
  }
  return { ...splats, shDegrees, sh };
}
