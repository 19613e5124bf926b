/** The training that is watched: how far it is, and how well. */

import { byId, fillFacts, make, makeSvg } from './dom';
import { count, duration } from './format';
import type { SessionTraining } from './session';

const TITLES = { running: 'Training', finished: 'Training finished', stopped: 'Training stopped' } as const;
const WIDTH = 240;
const HEIGHT = 64;

/** Shows a training; null: there is none. */
export function showTraining(training: SessionTraining | null): void {
    const card = byId<HTMLDetailsElement>('training');
    // Open where there is room for it, until someone closes it.
    if (card.hidden && training) card.open = Math.min(innerWidth, innerHeight) > 480 && training.state !== 'finished';
    card.hidden = !training;
    if (!training) return;
    const { step, steps, etaSecs, splats, texels, curve, state } = training;
    byId('training-state').textContent = TITLES[state] ?? 'Training';
    byId('training-step').textContent = `${count(step)} / ${count(steps)}`;
    Object.assign(byId<HTMLProgressElement>('training-progress'), { max: Math.max(steps, 1), value: step });
    fillFacts(byId('training-facts'), [
        ['Time left', state === 'running' && etaSecs !== null ? duration(etaSecs) : ''],
        ['Splats', count(splats)],
        ['Texels', count(texels)],
    ]);
    showCurve(curve.filter((point) => point.every(Number.isFinite)), training.curveOf === 'loss' ? 'Loss' : 'PSNR of the test views, dB');
}

function showCurve(curve: SessionTraining['curve'], title: string): void {
    const figure = byId('training-curve');
    figure.hidden = curve.length < 2;
    if (figure.hidden) return;
    const values = curve.map(([, value]) => value);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const [first, last] = [curve[0][0], curve[curve.length - 1][0]];
    const points = curve.map(([step, value]) => {
        const x = WIDTH * (step - first) / Math.max(last - first, 1), y = HEIGHT * (high - value) / (high - low || 1);
        return `${x.toFixed(1)},${y.toFixed(1)}`;
    });
    const number = (value: number) => value.toPrecision(4);
    const label = `${title}: from ${number(values[0])} to ${number(values[values.length - 1])}; lowest ${number(low)}, highest ${number(high)}`;
    const image = makeSvg('svg', { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: 'none', role: 'img', 'aria-label': label },
        makeSvg('line', { class: 'axis', x1: 0, y1: HEIGHT, x2: WIDTH, y2: HEIGHT }),
        makeSvg('polyline', { points: points.join(' ') }));
    const caption = make('figcaption', {}, make('span', {}, title), make('span', { className: 'figure' }, number(values[values.length - 1])));
    figure.replaceChildren(caption, image);
}
