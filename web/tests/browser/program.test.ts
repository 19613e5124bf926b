/** The page as the program serves it. */

import { type ChildProcess, execFileSync, spawn } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { afterAll, beforeAll, describe, expect, test } from 'vitest';
import { browserPath, WEB } from './browser';
import { difference, PageDriver, quiet, says, text } from './page-driver';

const PACK = join(WEB, '../samples/conformance');
const LTGS = readFileSync(join(PACK, 'balanced.ltgs'));

describe.skipIf(!browserPath() || !process.env.LITETEX)('program', () => {
    let driver: PageDriver;
    const folder = mkdtempSync(join(tmpdir(), 'page-'));

    beforeAll(async () => { driver = await PageDriver.start(); });
    afterAll(async () => {
        await driver?.close();
        rmSync(folder, { recursive: true });
    });

    test('works with the program', async () => {
        const { program, url } = await started(['view', join(PACK, 'balanced.ltgs'), '--no-open']);
        try {
            const opened = await driver.open(url);
            const own = await driver.open((await driver.serve(LTGS)).url);
            expect(difference(await driver.canvas(opened.page), await driver.canvas(own.page)).largest).toBe(0);
            quiet(opened, new URL(url).origin);
            program.kill();
            await says(opened.page, 'The program has ended.');
        } finally {
            program.kill();
        }
    });

    test('a training is seen to go on, and to be killed', async () => {
        const [capture, run] = [join(folder, 'capture'), join(folder, 'run')];
        execFileSync(process.env.LITETEX!, ['-q', 'sample', capture, '--views', '12', '--size', '64x48', '--points', '300', '--no-truth']);
        const training = await started(['train', capture, '-o', run, '--device', 'cpu', '--steps', '1000000', '--view=no-open']);
        const follower = await started(['view', run, '--no-open']);
        try {
            const { page } = await driver.open(training.url, { wait: false });
            await driver.drawn(page, ' splats');
            const first = await driver.canvas(page);
            const steps = () => page.waitForFunction(() => Number(/[\d,]+/.exec(document.getElementById('training-step')!.textContent!)?.[0].replace(',', '') ?? 0) >= 200);
            await steps();
            // The next preview; there is one every few seconds.
            await expect.poll(async () => difference(await driver.canvas(page), first).largest, { timeout: 40_000, interval: 1000 }).toBeGreaterThan(8);
            const other = (await driver.open(follower.url, { wait: false })).page;
            await driver.drawn(other, ' splats');
            expect(await text(other, 'training-state')).toBe('Training');
            training.program.kill('SIGKILL');
            await says(page, 'The program has ended.');
            await says(other, 'The training has stopped at step');
            expect(await text(other, 'training-state')).toBe('Training stopped');
        } finally {
            training.program.kill('SIGKILL');
            follower.program.kill();
        }
    });
});

/** Starts the program, and waits for the address that it prints. */
async function started(args: readonly string[]): Promise<{ program: ChildProcess; url: string }> {
    const program = spawn(process.env.LITETEX!, args, { stdio: ['ignore', 'pipe', 'pipe'] });
    const url = await new Promise<string>((resolve, reject) => {
        let said = '';
        const read = (data: Buffer) => {
            said += data;
            const found = /http:\/\/127\.0\.0\.1:\d+\/\S*/.exec(said);
            if (found) resolve(found[0]);
        };
        program.stdout.on('data', read);
        program.stderr.on('data', read);
        program.on('exit', () => reject(new Error(said)));
    });
    return { program, url };
}
