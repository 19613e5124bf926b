import type { SceneInfo, Splats } from '../../scene';
import { ByteQueue, utf8Of } from '../bytes';
import { checkSplats } from '../check';
import { invalid } from '../errors';
import { contentHash } from '../hash';
import { choiceOf, parseJson, textOf } from '../json';
import { checkMemory } from '../limits';
import { readMeta } from '../meta';
import type { ReaderOptions } from '../options';
import { concatenate, sliced } from '../splats';
import { xxh3 } from '../xxh3';
import { unpacked } from '../zstd';
import { type ChunkDecoder, type Geometry, type Sh, splatsOf } from './chunk';
import { ENTRY_BYTES, type Entry, HEADER_BYTES, type Header, blocksInOrder, readEntries, readHeader } from './header';
import { Lossless } from './lossless';
import { Lossy } from './lossy';
import { readQuantiser } from './quantiser';

/** What is there of a chunk of the layer in arrival. */
interface Arriving {
  geometry: Geometry;
  sh: Sh | null;
  splats: Splats;
  isComplete: boolean;
}

/** The part of a layer's chunks that is worth an update that sends splats again. */
const SHARE_OF_LAYER = 1 / 8;

/**
 * Reads a `.ltgs` file while it arrives (`exporters/schema/ltgs.md`). `push` takes bytes, `step` decodes one block; `end` says
 * that there are no more bytes. All three throw SceneError if the file is damaged.
 */
export class LtgsReader {
  info: SceneInfo | null = null;
  private readonly bytes = new ByteQueue();
  private header: Header | null = null;
  private entries: readonly Entry[] = [];
  private decoder!: ChunkDecoder;
  /** What the file says is the hash of its content, once `info` is there. */
  hash = '';
  /** Blocks that are wanted and still to come, and the next of them. */
  private blocks: { chunk: number; kind: number }[] = [];
  private next = 0;
  /** Chunks that are wanted. */
  private wanted = 0;
  private decodedTexels = 0;
  /** Chunks of the layer in arrival, its first chunk and that chunk's first splat. */
  private layer: Arriving[] = [];
  private firstChunk = 0;
  private firstSplat = 0;
  /** Chunks of the layer that have been shown, and those that have changed since, from the first one. */
  private shown = 0;
  private changed = new Set<number>();
  private readonly done: Splats[] = [];

  constructor(private readonly options: ReaderOptions = {}) {}

  /** Takes the next bytes of the file. */
  push(bytes: Uint8Array): void {
    this.bytes.push(bytes);
  }

  /** Whether everything that is wanted has been read. */
  get isDone(): boolean {
    return this.info !== null && this.next === this.blocks.length;
  }

  /** Does a part of the work; returns false if bytes are missing for the next one, or nothing is left. */
  step(): boolean {
    if (this.header === null) return this.readHeader();
    if (this.info === null) return this.readTables(this.header);
    if (this.isDone) return false;
    return this.readBlock(this.header);
  }

  /** Shows what has arrived and has not been shown yet. */
  show(): void {
    const isNew = this.layer.length > this.shown;
    const least = Math.ceil(SHARE_OF_LAYER * (this.entriesOfLayer() || 1));
    if (isNew || this.changed.size >= least) this.update();
  }

  /** The file has ended: shows what is there; an error if something is missing, or does not have the hash that the file states. */
  end(): void {
    while (this.step());
    if (this.changed.size > 0 || this.layer.length > this.shown) this.update();
    const { header, info } = this;
    const found = this.bytes.taken + this.bytes.waiting;
    if (header === null || info === null) throw invalid(`truncated: the file ends after ${found} bytes, within its header or tables`);
    if (!this.isDone) throw invalid(`truncated: ${found} bytes, the header says ${header.fileBytes}`);
    if (this.wanted < this.entries.length || this.done.reduce((sum, part) => sum + part.count, 0) < header.splats) return;
    if (found !== header.fileBytes) throw invalid(`${found} bytes, the header says ${header.fileBytes}`);
    const degree = this.done.reduce((most, part) => part.shDegrees.reduce((a, b) => Math.max(a, b), most), 0);
    if (degree !== header.shDegree) throw invalid(`SH degrees up to ${degree}, the header says ${header.shDegree}`);
    if (this.options.checkHash === false) return;
    const hash = contentHash(this.done, info);
    if (hash !== this.hash) throw invalid(`content of the hash ${hash}, the file says ${this.hash}: damaged`);
  }

  private readHeader(): boolean {
    const bytes = this.bytes.take(HEADER_BYTES);
    if (bytes === null) return false;
    this.header = readHeader(bytes);
    return true;
  }

  private readTables(header: Header): boolean {
    const tables = this.bytes.take(header.metaBytes + ENTRY_BYTES * header.chunks);
    if (tables === null) return false;
    const hash = xxh3(tables);
    if (hash !== header.tablesHash) throw invalid(`metadata and table of contents: checksum ${hash}, stated ${header.tablesHash}: damaged`);
    this.entries = readEntries(tables.subarray(header.metaBytes), header);
    const coded = tables.subarray(0, header.metaBytes);
    const text = header.metaIsCompressed ? unpacked(coded, header.metaTextBytes) : coded;
    if (text.length !== header.metaTextBytes) throw invalid(`metadata: ${text.length} bytes, the header says ${header.metaTextBytes}`);
    const about = parseJson(utf8Of(text), 'metadata');
    const isLossless = header.quality === 'lossless';
    choiceOf(about.quality, 'quality', [header.quality]);
    choiceOf(about.order, 'order', [isLossless ? 'given' : 'morton']);
    this.hash = textOf(about.hash, 'hash').toLowerCase();
    if (!/^[0-9a-f]{16}$/.test(this.hash)) throw invalid('hash: expected 16 hexadecimal digits');
    this.decoder = isLossless ? new Lossless(header.shDegree) : new Lossy(header.shDegree, readQuantiser(about.quantiser));
    this.choose(header);
    this.info = {
      container: 'ltgs',
      quality: header.quality,
      splats: header.splats,
      texels: header.texels,
      shDegree: header.shDegree,
      ...readMeta(about.meta),
      untextured: null,
      fileBytes: header.fileBytes,
    };
    this.options.onInfo?.(this.info);
    return true;
  }

  /** Chooses the chunks that `maxSplats` asks for. */
  private choose(header: Header): void {
    const most = this.options.maxSplats ?? Infinity;
    let splats = 0;
    let texels = 0;
    for (; this.wanted < this.entries.length && splats < most; this.wanted += 1) {
      splats += this.entries[this.wanted].splats;
      texels += this.entries[this.wanted].texels;
    }
    checkMemory(splats, texels, header.shDegree, header.fileBytes);
    this.blocks = blocksInOrder(this.entries).filter(({ chunk }) => chunk < this.wanted);
  }

  private readBlock(header: Header): boolean {
    const { chunk, kind } = this.blocks[this.next];
    const entry = this.entries[chunk];
    const { offset, bytes: size, hash } = entry.blocks[kind];
    if (!this.bytes.skip(offset - this.bytes.taken)) return false;
    const data = this.bytes.take(size);
    if (data === null) return false;
    const found = xxh3(data);
    if (found !== hash) throw invalid(`chunk ${chunk}: checksum ${found}, stated ${hash}: damaged`);
    this.next += 1;
    this.decode(chunk, kind, data, entry, header);
    const following = this.blocks[this.next];
    if (kind === 2 && (following === undefined || following.kind === 0)) this.finishLayer();
    return true;
  }

  private decode(chunk: number, kind: number, data: Uint8Array, entry: Entry, header: Header): void {
    const place = chunk - this.firstChunk;
    if (kind === 0) {
      const geometry = this.decoder.geometry(data, entry.splats);
      if (geometry.texels !== entry.texels) throw invalid(`chunk ${chunk}: maps of ${geometry.texels} texels, the table of contents says ${entry.texels}`);
      this.decodedTexels += geometry.texels;
      checkMemory(this.firstSplat + this.layer.length * entry.splats, this.decodedTexels, header.shDegree, this.bytes.taken + this.bytes.waiting);
      const splats = splatsOf(geometry, null, null);
      checkSplats(splats);
      this.layer.push({ geometry, sh: null, splats, isComplete: false });
      return;
    }
    const own = this.layer[place];
    if (kind === 1) {
      own.sh = this.decoder.sh(data, own.geometry);
      if (header.shDegree === 0) return;
      own.splats = splatsOf(own.geometry, own.sh, null);
    } else {
      own.splats = splatsOf(own.geometry, own.sh, this.decoder.texels(data, own.geometry));
      own.isComplete = true;
      checkSplats(own.splats);
    }
    this.changed.add(place);
  }

  private finishLayer(): void {
    this.update();
    const all = concatenate(this.layer.map((own) => own.splats));
    const most = (this.options.maxSplats ?? Infinity) - this.firstSplat;
    this.done.push(sliced(all, 0, Math.min(all.count, most)));
    this.firstChunk += this.layer.length;
    this.firstSplat += all.count;
    this.layer = [];
    this.shown = 0;
  }

  /** Gives the splats of the layer from the first that have changed on. */
  private update(): void {
    const from = Math.min(this.shown, ...this.changed);
    const first = this.layer.slice(0, from).reduce((sum, own) => sum + own.splats.count, this.firstSplat);
    const parts = this.layer.slice(from);
    const all = concatenate(parts.map((own) => own.splats));
    const most = (this.options.maxSplats ?? Infinity) - first;
    const splats = sliced(all, 0, Math.min(all.count, most));
    this.shown = this.layer.length;
    this.changed.clear();
    this.options.onUpdate?.({ first, splats, bytes: this.bytes.taken, complete: parts.every((own) => own.isComplete) });
  }

  /** Chunks that the layer in arrival will have. */
  private entriesOfLayer(): number {
    const layer = this.entries[this.firstChunk]?.layer;
    return this.entries.filter((entry) => entry.layer === layer).length;
  }
}
