import { defineConfig } from 'vitest/config';

// One file after the other: each starts a browser that draws on the processor.
export default defineConfig({ test: { include: ['tests/browser/**/*.test.ts', 'tests/built/**/*.test.ts'], fileParallelism: false, testTimeout: 120_000, hookTimeout: 180_000 } });
