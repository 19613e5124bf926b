/** What is said of a file that does not come, by its address and that of the page. */

import { afterEach, expect, test, vi } from 'vitest';
import { fetchFile } from '../../src/core/worker/fetch-file';

afterEach(() => vi.unstubAllGlobals());

async function messageOf(page: string, url: string, isOnline = true, answer: () => Promise<Response> = () => Promise.reject(new TypeError('Failed to fetch'))): Promise<string> {
    vi.stubGlobal('origin', page);
    vi.stubGlobal('navigator', { onLine: isOnline });
    vi.stubGlobal('fetch', answer);
    return fetchFile(url).then(() => 'none', (error: Error) => error.message);
}

test.each([
    ['https://a.org', 'https://b.org/x.ltgs', /^https:\/\/b\.org\/x\.ltgs: the server does not answer, or does not allow pages of https:\/\/a\.org .*Access-Control-Allow-Origin: https:\/\/a\.org,/],
    ['https://a.org', 'http://localhost:8000/x.ltgs', /Access-Control-Allow-Origin: https:\/\/a\.org/],
    ['null', 'https://b.org/x.ltgs', /pages of null .*Access-Control-Allow-Origin: \*/],
    ['https://a.org', 'http://b.org/x.ltgs', /^http:\/\/b\.org\/x\.ltgs: a page served over https may not fetch over http; use an address that begins with https:/],
    ['http://a.org', 'http://a.org/x.ltgs', /^http:\/\/a\.org\/x\.ltgs: the server does not answer; does it run/],
    ['null', 'file:///x.ltgs', /^file:\/\/\/x\.ltgs: browsers fetch nothing from the disk; serve the folder over http/],
    ['http://a.org', 's3://b/x.ltgs', /^s3:\/\/b\/x\.ltgs: browsers fetch nothing from s3:; expected an address that begins with https:/],
])('a page of %s, the file %s', async (page, url, expected) => {
    const message = await messageOf(page, url);
    expect(message).toMatch(expected);
    expect(message).toContain('Failed to fetch');
});

test('offline, nothing else is said', async () => {
    expect(await messageOf('http://a.org', 'http://b.org/x', false)).toBe('http://b.org/x: this device is offline (the browser says: Failed to fetch)');
});

test('answers of the server', async () => {
    const answer = (status: number, statusText: string) => () => Promise.resolve(new Response('', { status, statusText }));
    expect(await messageOf('http://a.org', 'http://a.org/x', true, answer(404, 'Not Found'))).toBe('http://a.org/x: the server answers 404 Not Found; is the address right?');
    expect(await messageOf('http://a.org', 'http://a.org/x', true, answer(503, ''))).toBe('http://a.org/x: the server answers 503');
    expect(await messageOf('http://a.org', 'http://a.org/x', true, answer(200, 'OK'))).toBe('none');
});

test('who stops it gets the reason, not a remedy', async () => {
    const abort = () => Promise.reject(new DOMException('stopped', 'AbortError'));
    expect(await messageOf('http://a.org', 'http://b.org/x', true, abort)).toBe('stopped');
});
