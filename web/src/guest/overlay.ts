/**
 * Splats in a render target of linear light. They are blended in a target of their own, in the space that they were
 * trained in, against the depth of the bound one; then that image is laid over what is there as if that, too, were of
 * their space. So images are those of a target of display values. Converting each splat instead changes what blending
 * gives (measured on a photographed scene: 25 dB).
 */

import { asGuest } from '../core/render/guest';
import vertex from '../core/render/shaders/resolve.vert.glsl?raw';
import fragment from './overlay.frag.glsl?raw';
import { OverlayTarget } from './overlay-target';

/** Sources of the shaders that lay one image over the other, with `splats`, `behind` and `linear`. */
export const OVERLAY_SHADERS = { vertex, fragment } as const;

/** Targets that are kept, for as many sizes. */
const MAX_TARGETS = 3;
/** Textures of each. */
const TEXTURES = 2;

export class Overlay {
    private readonly targets = new Map<string, OverlayTarget>();
    private open: { own: OverlayTarget; bound: WebGLFramebuffer } | null = null;

    /** `counted` is told how many textures were made or, below zero, deleted. */
    constructor(private readonly gl: WebGL2RenderingContext, private readonly counted: (textures: number) => void = () => {}) {}

    /** From here to `end`, what is drawn goes into a target of its own, with the size, samples and depth of the bound one. False if that cannot be had. */
    begin(width: number, height: number, samples: number): boolean {
        const { gl } = this;
        const bound = gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING) as WebGLFramebuffer | null;
        if (!bound) return false; // the depth of a canvas cannot be shared
        const ask = (attachment: number, name: number) => gl.getFramebufferAttachmentParameter(gl.DRAW_FRAMEBUFFER, attachment, name);
        const depthType = ask(gl.DEPTH_ATTACHMENT, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_TYPE) as number;
        const depth = depthType === gl.NONE ? null : ask(gl.DEPTH_ATTACHMENT, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_NAME) as WebGLRenderbuffer | WebGLTexture;
        // Multisampled colours can be resolved into the same format only.
        const colour = samples > 0 ? ask(gl.COLOR_ATTACHMENT0, gl.FRAMEBUFFER_ATTACHMENT_OBJECT_NAME) as WebGLRenderbuffer : null;
        const own = this.own(width, height, samples, colour);
        if (!own.share(depth, depthType)) {
            gl.bindFramebuffer(gl.FRAMEBUFFER, bound);
            return false;
        }
        gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
        this.open = { own, bound };
        return true;
    }

    /** Binds what was bound before, and gives what `OVERLAY_SHADERS` are to lay over it: the splats, and a copy of what is there. Null if nothing has begun. */
    end(): { readonly splats: WebGLTexture; readonly behind: WebGLTexture } | null {
        if (!this.open) return null;
        const { own, bound } = this.open;
        this.open = null;
        own.resolve(bound);
        return { splats: own.colours, behind: own.behind };
    }

    dispose(): void {
        for (const key of [...this.targets.keys()]) this.drop(key);
    }

    private own(width: number, height: number, samples: number, colour: WebGLRenderbuffer | null): OverlayTarget {
        const { gl } = this;
        let format: number = gl.RGBA16F;
        if (colour) {
            gl.bindRenderbuffer(gl.RENDERBUFFER, colour);
            format = gl.getRenderbufferParameter(gl.RENDERBUFFER, gl.RENDERBUFFER_INTERNAL_FORMAT) as number;
            gl.bindRenderbuffer(gl.RENDERBUFFER, null);
        }
        const key = [width, height, samples, format].join();
        let own = this.targets.get(key);
        this.targets.delete(key); // the latest used stands last
        if (!own) {
            if (this.targets.size >= MAX_TARGETS) this.drop(this.targets.keys().next().value!);
            own = asGuest(gl, () => new OverlayTarget(gl, width, height, samples, format));
            this.counted(TEXTURES);
        }
        this.targets.set(key, own);
        return own;
    }

    private drop(key: string): void {
        this.targets.get(key)!.dispose();
        this.targets.delete(key);
        this.counted(-TEXTURES);
    }
}
