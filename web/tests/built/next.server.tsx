/** What Next does on the server: HTML of the pages of `examples/next`, which `script` takes over. */

import { renderToReadableStream } from 'react-dom/server';
import Layout from '../../examples/next/app/layout';
import Page from '../../examples/next/app/page';

export async function html(script: string): Promise<string> {
    return new Response(await renderToReadableStream(<Layout><Page /></Layout>, { bootstrapModules: [script] })).text();
}
