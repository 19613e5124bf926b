/** Splats are drawn in batches: an instance of one splat is a draw of its own in software, and fills few lanes of hardware. */

/** Splats of an instance: 768 indices of 16 bits. */
export const SPLATS_PER_BATCH = 128;

/** Two triangles for each splat of a batch: vertex 4 s + c is corner c of splat s. */
export function batchIndices(): number[] {
    const splats = Array.from({ length: SPLATS_PER_BATCH }, (_, splat) => 4 * splat);
    return splats.flatMap((first) => [0, 1, 2, 2, 1, 3].map((corner) => first + corner));
}

/** Instances that draw this many splats: those of the last one beyond them have no fragments. */
export function batchesOf(splats: number): number {
    return Math.ceil(splats / SPLATS_PER_BATCH);
}
