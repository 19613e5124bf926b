/** Who prefers it gets no motion that goes on by itself. Undefined where there is no window, as on servers. */
export const reducedMotion: MediaQueryList | undefined = globalThis.matchMedia?.('(prefers-reduced-motion: reduce)');
