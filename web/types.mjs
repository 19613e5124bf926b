// Completes the imports of declarations, which Node.js resolution wants with their extensions: node types.mjs FOLDER
import { existsSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';

const [root] = process.argv.slice(2);
for (const name of readdirSync(root, { recursive: true }).filter((path) => path.endsWith('.d.ts'))) {
    const file = join(root, name);
    const text = readFileSync(file, 'utf8').replace(/((?:from|import)\s*\(?['"])(\.[^'"]*)(['"])/g, (_, before, path, after) => {
        const at = join(dirname(file), path);
        if (existsSync(`${at}.d.ts`)) return `${before}${path}.js${after}`;
        if (existsSync(join(at, 'index.d.ts'))) return `${before}${path}/index.js${after}`;
        throw new Error(`${name}: imports ${path}, which has no declarations`);
    });
    writeFileSync(file, text);
}
