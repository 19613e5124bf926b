/** Takes WebGL contexts away, and gives them back, as browsers do with tabs in the background. In pages, by name. */

/** To be run in a page before its scripts: `lose(canvas)` and `restore(canvas)`, and `contexts()`, which counts those that live. */
export function setUpLoss(): void {
    const known: WebGL2RenderingContext[] = [];
    const extensions = new Map<HTMLCanvasElement, WEBGL_lose_context>();
    const { prototype } = HTMLCanvasElement;
    const get = prototype.getContext as (this: HTMLCanvasElement, ...args: unknown[]) => RenderingContext | null;
    prototype.getContext = function (this: HTMLCanvasElement, ...args: unknown[]) {
        const context = get.apply(this, args);
        if (context instanceof WebGL2RenderingContext && !known.includes(context)) {
            known.push(context);
            extensions.set(this, context.getExtension('WEBGL_lose_context')!);
        }
        return context;
    } as typeof prototype.getContext;
    const heard = (canvas: HTMLCanvasElement, name: string) => new Promise((resolve) => canvas.addEventListener(name, resolve, { once: true }));
    Object.assign(window, {
        async lose(canvas: HTMLCanvasElement) {
            const lost = heard(canvas, 'webglcontextlost');
            extensions.get(canvas)!.loseContext();
            await lost;
            await new Promise((resolve) => setTimeout(resolve));
        },
        async restore(canvas: HTMLCanvasElement) {
            const restored = heard(canvas, 'webglcontextrestored');
            extensions.get(canvas)!.restoreContext();
            await restored;
        },
        contexts: () => known.filter((context) => !context.isContextLost()).length,
    });
}

/** What `setUpLoss` adds to a page's window. */
export interface LossWindow {
    lose(canvas: HTMLCanvasElement): Promise<void>;
    restore(canvas: HTMLCanvasElement): Promise<void>;
    contexts(): number;
}
