#!/usr/bin/env bash
# Checks the web package: scripts/web.sh BINARY ASSETS
#
# BINARY: the program. ASSETS: a folder with what `cargo run --example conformance -p litetex-exporters -- ASSETS` writes.
# Needs Node.js 20 or newer with npm; the images need Chromium. Installs the package's tools at the versions of its lock file.
# Ends with a line in the manner of cargo's tests.
set -euo pipefail

if [ $# -ne 2 ] || [ ! -x "$1" ] || [ ! -d "$2" ]; then
    echo "usage: scripts/web.sh BINARY ASSETS" >&2
    exit 2
fi
LITETEX=$(realpath "$1")
LITETEX_ASSETS=$(realpath "$2")
export LITETEX LITETEX_ASSETS
cd "$(dirname "$0")/../web"

if ! command -v node >/dev/null || ! command -v npm >/dev/null || [ "$(node -p 'parseInt(process.versions.node)')" -lt 20 ]; then
    echo "web package: skipped, node 20 or newer with npm is missing"
    [ "${LITETEX_REQUIRE_BROWSER:-0}" = 0 ] || exit 1
    exit 0
fi
if ! cmp -s package-lock.json node_modules/.installed; then
    npm ci --no-audit --no-fund --ignore-scripts --loglevel=error
    cp package-lock.json node_modules/.installed
fi
npm run --silent check
results=$(mktemp -d)
trap 'rm -rf "$results"' EXIT
npx vitest run --reporter=default --reporter=json --outputFile.json="$results/units.json"
npx vitest run --config vitest.slow.config.ts --reporter=verbose --reporter=json --outputFile.json="$results/slow.json"
node -e '
    const all = process.argv.slice(1).map((path) => JSON.parse(require("node:fs").readFileSync(path, "utf8")));
    const sum = (name) => all.reduce((total, one) => total + one[name], 0);
    console.log(`test result: ok. ${sum("numPassedTests")} passed; ${sum("numFailedTests")} failed; ${sum("numPendingTests")} ignored; of the web package`);
' "$results/units.json" "$results/slow.json"
