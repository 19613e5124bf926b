import { defineConfig } from 'vite';
import { glsl } from './vite.glsl';

// The package: one module per entry point, which share what they have in common.
export default defineConfig({
    plugins: [glsl()],
    build: {
        target: 'es2022',
        outDir: 'dist',
        lib: {
            entry: { core: 'src/core/index.ts', read: 'src/core/read/index.ts', three: 'src/three/index.ts', playcanvas: 'src/playcanvas/index.ts', element: 'src/element/index.ts' },
            formats: ['es'],
        },
        rolldownOptions: { external: [/^(three|playcanvas)($|\/)/], output: { minify: true } },
    },
});
