import type { Plugin } from 'vite';

/** Leaves comments and indentation out of shaders, which are a fifth of the package. */
export function glsl(): Plugin {
    return {
        name: 'glsl',
        enforce: 'pre',
        load: {
            filter: { id: /\.glsl\?raw$/ },
            async handler(id) {
                const { readFile } = await import('node:fs/promises');
                const source = await readFile(id.replace('?raw', ''), 'utf8');
                const lines = source.replace(/\/\/.*$/gm, '').split('\n').map((line) => line.trim()).filter(Boolean);
                // With a last line break: sources are joined.
                return `export default ${JSON.stringify(`${lines.join('\n')}\n`)}`;
            },
        },
    };
}
