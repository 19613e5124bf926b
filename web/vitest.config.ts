import { defineConfig } from 'vitest/config';

// Files of 100-byte pieces take over 5 s, the default, on two busy cores.
export default defineConfig({ test: { include: ['tests/unit/**/*.test.ts'], testTimeout: 60_000 } });
