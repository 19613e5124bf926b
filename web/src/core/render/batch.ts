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

/** Draws quads without attributes: the vertex shader finds its splat by instance and vertex. */
export class Batches {
    private readonly vertexArray: WebGLVertexArrayObject;
    private readonly indices: WebGLBuffer;

    constructor(private readonly gl: WebGL2RenderingContext) {
        this.vertexArray = gl.createVertexArray()!;
        this.indices = gl.createBuffer()!;
        gl.bindVertexArray(this.vertexArray);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(batchIndices()), gl.STATIC_DRAW);
        gl.bindVertexArray(null);
    }

    draw(splats: number): void {
        const { gl } = this;
        gl.bindVertexArray(this.vertexArray);
        gl.drawElementsInstanced(gl.TRIANGLES, 6 * SPLATS_PER_BATCH, gl.UNSIGNED_SHORT, 0, batchesOf(splats));
        gl.bindVertexArray(null);
    }

    dispose(): void {
        this.gl.deleteBuffer(this.indices);
        this.gl.deleteVertexArray(this.vertexArray);
    }
}
