/** The order of splats, whatever becomes of the worker that makes it. */

import { beforeEach, expect, test, vi } from 'vitest';
import { Order } from '../../src/core/render/order';
import { Sorter } from '../../src/core/render/sort';
import type { View } from '../../src/core/render/view';
import type { FromWorker, ToWorker } from '../../src/core/worker/messages';

/** A worker that is told what to do by the test. */
const fake = { posted: [] as ToWorker[], answer: (_: FromWorker): void => {}, terminated: 0 };
vi.mock('../../src/core/worker/start', () => ({
    startWorker: (receive: (message: FromWorker) => void) => {
        fake.answer = receive;
        return { postMessage: (message: ToWorker) => fake.posted.push(message), terminate: () => { fake.terminated++; } };
    },
}));
beforeEach(() => { Object.assign(fake, { posted: [], terminated: 0 }); });

const CENTRES = new Float32Array([0, 0, 3, 0, 0, 1, 0, 0, 2]);
const FAILED: FromWorker = { kind: 'failed', errorKind: null, message: 'out of memory' };
const view = (z: number): View => ({ rotation: [1, 0, 0, 0, 1, 0, 0, 0, z], translation: [0, 0, 0], focalPx: [1, 1], principalPx: [0, 0], widthPx: 1, heightPx: 1 });

function answerAsWorker(): void {
    const sorter = new Sorter();
    for (const message of fake.posted.splice(0)) {
        if (message.kind === 'positions') sorter.set(message.first, message.xyz);
        if (message.kind !== 'sort') continue;
        const order = new Uint32Array(sorter.count);
        sorter.sort(message.view, order);
        fake.answer({ kind: 'order', order, generation: message.generation, ms: 1 });
    }
}

test('a worker that works makes the orders', async () => {
    const orders: number[][] = [];
    const order = new Order((made) => orders.push([...made]));
    order.setPositions(0, CENTRES);
    order.request(view(1));
    expect(orders).toEqual([]);
    answerAsWorker();
    await order.settled();
    expect(orders).toEqual([[0, 2, 1]]);
});

test.each([['before it is asked', true], ['when it is asked', false]])('splats are sorted without a worker that fails %s', async (_, early) => {
    const orders: number[][] = [];
    const order = new Order((made) => orders.push([...made]));
    order.setPositions(0, CENTRES.subarray(0, 3));
    order.setPositions(1, CENTRES.subarray(3));
    if (early) fake.answer(FAILED);
    order.request(view(1));
    const settled = order.settled();
    if (!early) fake.answer(FAILED);
    await settled;
    expect(orders).toEqual([[0, 2, 1]]);
    expect(fake.terminated).toBe(1);
    order.request(view(-1));
    expect(orders[1]).toEqual([1, 2, 0]);
    order.setPositions(1, CENTRES.subarray(3, 6));
    order.request(view(-1));
    expect(orders[2]).toEqual([1, 0]);
});

test('what is asked for while a worker fails is the latest view', async () => {
    const orders: number[][] = [];
    const order = new Order((made) => orders.push([...made]));
    order.setPositions(0, CENTRES);
    order.request(view(1));
    order.request(view(-1));
    fake.answer(FAILED);
    await order.settled();
    expect(orders).toEqual([[1, 2, 0]]);
});
