#!/usr/bin/env bash
# Shows exported files in other programs and compares their images with ours: scripts/viewers.sh BINARY RUN CAPTURE [OUT_DIR] [IMAGES]
#
# Needs what scripts/third-party.sh needs. Exports RUN, which was trained on CAPTURE, in all formats, renders its home view in each
# program in headless Chromium on software drivers, and prints the table of docs/viewers.md; takes some minutes. IMAGES gets small
# JPEGs of what was seen.
set -euo pipefail

if [ $# -lt 3 ] || [ ! -x "$1" ]; then
    echo "usage: scripts/viewers.sh BINARY RUN CAPTURE [OUT_DIR] [IMAGES]" >&2
    exit 2
fi
binary=$(realpath "$1") run=$(realpath "$2") capture=$(realpath "$3")
cd "$(dirname "$0")/.."
cache=${CARGO_TARGET_DIR:-target}/viewers
out=${4:-$cache/out}
images=${5:-$out/small}
mkdir -p "$cache/node" "$out/files"
cp scripts/viewers/*.mjs scripts/viewers/package*.json "$cache/node/"
if ! cmp -s "$cache/node/package-lock.json" "$cache/node/installed"; then
    (cd "$cache/node" && npm ci --no-audit --no-fund --ignore-scripts --loglevel=error)
    cp "$cache/node/package-lock.json" "$cache/node/installed"
fi
if [ ! -x "$cache/venv/bin/python" ]; then
    python3 -m venv "$cache/venv"
    grep -E '^(numpy|pillow)==' tests/third_party/requirements.txt >"$cache/requirements.txt"
    "$cache/venv/bin/pip" install -q --disable-pip-version-check -r "$cache/requirements.txt"
fi
python=$cache/venv/bin/python
export PYTHONDONTWRITEBYTECODE=1
(
    cd web
    if ! cmp -s package-lock.json node_modules/.installed; then
        npm ci --no-audit --no-fund --ignore-scripts --loglevel=error
        cp package-lock.json node_modules/.installed
    fi
    npm run --silent build >/dev/null
)
export LITETEX_WEB=$PWD/web/dist

files=$out/files
export_to() { "$binary" -q export "$run" --no-verify --force "$@" >/dev/null; }
export_to -o "$files"/balanced.glb --mesh
export_to -o "$files"/scene.{ply,spz,usdz} --device cpu
export_to -o "$files"/y.ply --up :y
export_to -o "$files"/mesh.usdz --mesh
export_to -o "$files"/tiny.glb --quality tiny --device cpu
"$python" scripts/viewers/jobs.py "$files" "$capture" "$binary" "$out"
node "$cache/node/render.mjs" "$out/jobs.json" "$out"
"$python" scripts/viewers/table.py "$out" "$images"
