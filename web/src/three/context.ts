/** What a renderer of three.js is for scenes that are drawn in it. */

import type { WebGLRenderer } from 'three';
import type { Context } from '../guest/gpu';
import { Composite } from './composite';

export class RendererContext implements Context {
    readonly gl: WebGL2RenderingContext;
    readonly composite: Composite;
    /** Another one after the loss of the context. */
    private readonly state: WebGLRenderer['state'];

    constructor(private readonly renderer: WebGLRenderer) {
        this.gl = renderer.getContext() as WebGL2RenderingContext;
        this.state = renderer.state;
        this.composite = new Composite(renderer, (textures) => this.counted(textures));
    }

    alive(): boolean {
        return this.state === this.renderer.state;
    }

    counted(textures: number): void {
        this.renderer.info.memory.textures += textures;
    }

    dispose(): void {
        this.composite.dispose();
    }
}
