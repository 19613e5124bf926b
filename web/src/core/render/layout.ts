/** Places of maps in an atlas whose texels the hardware interpolates. */

/** Columns of the atlas. */
export const ATLAS_COLUMNS = 2048;
/** The place of splats without a map, and of those that found no room. */
export const NO_PLACE = 0xffffffff;

/** Texels of a map's block along an axis: a border of one texel before the map, and before each copy halved once more. */
export function extentOf(side: number, halvings: number): number {
    let sum = 1 + side;
    for (let halved = 0; halved < halvings; halved++) {
        side = Math.ceil(side / 2);
        sum += 1 + side;
    }
    return sum;
}

/**
 * Packs blocks onto shelves, high ones first. Each has its border above and on the left; below and on the right lies that of others,
 * or nothing. Splats that arrive later stand on shelves below.
 */
export class AtlasLayout {
    /** Column + 65536 row of each splat's block, or NO_PLACE. */
    readonly places: Uint32Array;
    /** Splats that have been considered. */
    count = 0;
    /** Rows that are used, with one below that is free. */
    rows = 1;
    /** Splats and rows that were there before each call of `extend`. */
    private readonly marks: { readonly count: number; readonly rows: number }[] = [];

    constructor(capacity: number, private readonly maxRows: number, private readonly halvings: number) {
        this.places = new Uint32Array(capacity).fill(NO_PLACE);
    }

    /** Forgets splats from `first` on, and those that were placed together with it. */
    truncate(first: number): void {
        while (this.count > first) {
            const { count, rows } = this.marks.pop()!;
            this.count = count;
            this.rows = rows;
        }
    }

    /** Places splats up to `end`, whose sides are rows + 65536 columns; 0 without a map. */
    extend(sides: Uint32Array, end: number): void {
        const { count: first, places, halvings } = this;
        if (end <= first) return;
        this.marks.push({ count: first, rows: this.rows });
        places.fill(NO_PLACE, first, end);
        const blocks = [];
        for (let splat = first; splat < end; splat++) {
            const side = sides[splat];
            if (side) blocks.push({ splat, height: extentOf(side & 0xffff, halvings), width: extentOf(side >>> 16, halvings) });
        }
        blocks.sort((a, b) => b.height - a.height || b.width - a.width || a.splat - b.splat);
        let row = this.rows - 1, column = 0, shelf = 0;
        for (const { splat, height, width } of blocks) {
            if (column + width >= ATLAS_COLUMNS) {
                row += shelf;
                column = shelf = 0;
            }
            if (column + width >= ATLAS_COLUMNS || row + height >= this.maxRows) continue;
            places[splat] = row * 65536 + column;
            column += width;
            shelf = Math.max(shelf, height);
        }
        this.rows = row + shelf + 1;
        this.count = end;
    }
}
