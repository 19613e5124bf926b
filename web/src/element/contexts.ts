/** The few WebGL contexts that a browser allows on a page, shared by the elements that want one. */

/** Chrome on Android allows 8 on a page, other browsers 16, and take the oldest away; some are left to the rest of the page. */
export const MOST_CONTEXTS = 6;

export interface Sharer {
    /** How much it wants a context; 0: not at all. It gets a free one, or that of the sharer with the least `hold`, if that is less. */
    wish(): number;
    hold(): number;
    take(): void;
    give(): void;
}

const waiting = new Set<Sharer>();
/** The one used longest ago stands first. */
const holding = new Set<Sharer>();

/** Lets one share: it waits. */
export function join(sharer: Sharer): void {
    waiting.add(sharer);
    settle();
}

/** Lets one go, which gives its context up. */
export function leave(sharer: Sharer): void {
    waiting.delete(sharer);
    if (holding.delete(sharer)) sharer.give();
    settle();
}

/** To be called when someone uses what a sharer shows. */
export function use(sharer: Sharer): void {
    if (holding.delete(sharer)) holding.add(sharer);
    settle();
}

/** To be called when wishes have changed. */
export function settle(): void {
    for (;;) {
        const next = [...waiting].reduce<Sharer | null>((best, sharer) => (sharer.wish() > (best?.wish() ?? 0) ? sharer : best), null);
        if (!next) return;
        if (holding.size >= MOST_CONTEXTS) {
            const last = [...holding].reduce((least, sharer) => (sharer.hold() < least.hold() ? sharer : least));
            if (last.hold() >= next.wish()) return;
            holding.delete(last);
            waiting.add(last);
            last.give();
        }
        waiting.delete(next);
        holding.add(next);
        next.take();
    }
}
