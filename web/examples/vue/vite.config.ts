import vue from '@vitejs/plugin-vue';
import { defineConfig } from 'vite';

// Templates leave the element to the browser.
export default defineConfig({ plugins: [vue({ template: { compilerOptions: { isCustomElement: (tag) => tag === 'litetex-viewer' } } })] });
