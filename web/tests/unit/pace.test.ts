/** What is given up while the camera moves, and how images at rest are drawn. */

import { beforeEach, expect, test, vi } from 'vitest';
import { Pace } from '../../src/viewer/pace';

let now = 0;
beforeEach(() => {
    now = 1000;
    vi.spyOn(performance, 'now').mockImplementation(() => now);
});

const pace = () => new Pace({} as WebGL2RenderingContext);

/** Draws images that take this long, moving. */
function move(of: Pace, images: number, ms: number): void {
    for (let i = 0; i < images; i++) {
        of.moved();
        of.drawn = of.planAt(now);
        for (let left = ms; left > 0; left -= 100) {
            now += Math.min(100, left);
            of.moved();
        }
        of.learn(ms);
    }
}

test('images in time stay whole, and are fast', () => {
    const of = pace();
    move(of, 100, 20);
    expect(of.planAt(now)).toEqual({ ratio: 1, share: 1, precision: 'fast', moving: true });
});

test('twenty images that take longer are followed by smaller ones; nineteen are not', () => {
    const of = pace();
    move(of, 19, 26);
    expect(of.planAt(now).ratio).toBe(1);
    move(of, 1, 26);
    expect(of.planAt(now).ratio).toBeLessThan(1);
    expect(of.planAt(now).share).toBe(1);
});

test('one slow image among many changes nothing', () => {
    const of = pace();
    move(of, 10, 10);
    move(of, 1, 200);
    move(of, 9, 10);
    expect(of.planAt(now).ratio).toBe(1);
});

test('a slow device gives up size at once, then splats', () => {
    const of = pace();
    move(of, 1, 700);
    expect(of.planAt(now)).toMatchObject({ ratio: 0.35, share: 0.25 });
    move(of, 20, 700);
    expect(of.planAt(now)).toMatchObject({ ratio: 0.25, share: 0.25 });
});

test('at rest the image is whole, and the next movement begins a step better', () => {
    const of = pace();
    move(of, 5, 110);
    expect(of.planAt(now).ratio).toBe(0.5);
    now += 200;
    expect(of.isUnsettled && of.isResting(now)).toBe(true);
    expect(of.planAt(now)).toMatchObject({ ratio: 1, share: 1, moving: false });
    of.moved();
    expect(of.planAt(now).ratio).toBe(0.71);
});

test('at rest images are exact where that takes little time', () => {
    const of = pace();
    const rest = (ms: number) => {
        of.drawn = of.planAt(now);
        of.learn(ms);
        return of.drawn.precision;
    };
    expect(rest(40)).toBe('fast'); // nothing is known yet
    expect(of.isUnsettled).toBe(true);
    expect(rest(90)).toBe('exact');
    expect(of.isUnsettled).toBe(false);
    expect(rest(120)).toBe('exact'); // as good as the one before
    expect(rest(40)).toBe('fast'); // too slow after all
    expect(of.isUnsettled).toBe(false);
    of.forget(); // of another size
    expect(rest(60)).toBe('fast');
    expect(of.isUnsettled).toBe(false);
});

test.each(['exact', 'fast'] as const)('%s is what is drawn if it is asked for', (precision) => {
    const of = pace();
    of.precision = precision;
    expect(of.planAt(now).precision).toBe(precision);
    of.moved();
    expect(of.planAt(now).precision).toBe(precision);
    expect(of.planAt(now + 1000).precision).toBe(precision);
});
