import { type ChunkDecoder, type Geometry, type Sh, type Texels } from './chunk';
import { readGeometry } from './geometry';
import type { Quantiser } from './quantiser';
import { readSh } from './sh';
import { readTexels } from './texels';

/** Decodes the chunks of a balanced, tiny or custom file. */
export class Lossy implements ChunkDecoder {
  constructor(
    private readonly degree: number,
    private readonly quantiser: Quantiser,
  ) {}

  geometry(data: Uint8Array, count: number): Geometry {
    return readGeometry(data, count, this.quantiser);
  }

  sh(data: Uint8Array, geometry: Geometry): Sh {
    return readSh(data, geometry, this.degree, this.quantiser.steps);
  }

  texels(data: Uint8Array, geometry: Geometry): Texels {
    return readTexels(data, geometry, this.quantiser.steps);
  }
}
