#!/usr/bin/env bash
# Validates exported files with third-party tools: scripts/third-party.sh BINARY [OUT_DIR]
#
# Needs Node.js 20 or newer with npm, Python 3.11 or newer with venv, and Chromium. Downloads the validators once, at
# pinned versions (tests/third_party/), into target/third-party/. Prints one line per validator; exit code 1 if one fails.
#
# A validator that cannot be installed is skipped, and the reason printed; with LITETEX_REQUIRE_THIRD_PARTY=1 that is a
# failure. LITETEX_USD_SAMPLES names a folder of USD samples, written by the tests of exporters/, to validate as well.
set -euo pipefail

if [ $# -lt 1 ] || [ ! -x "$1" ]; then
    echo "usage: scripts/third-party.sh BINARY [OUT_DIR]" >&2
    exit 2
fi
binary=$(realpath "$1")
cd "$(dirname "$0")/.."
cache=${CARGO_TARGET_DIR:-target}/third-party
out=${2:-$cache/out}
mkdir -p "$cache" "$out"
cache=$(realpath "$cache")
out=$(realpath "$out")
tests=$PWD/tests
validators=$tests/third_party
lines=()
failed=0
skipped=0
export PYTHONDONTWRITEBYTECODE=1

# report LINE: prints it now and again in the summary.
report() { printf '%s\n' "$1"; lines+=("$1"); }
# skip VALIDATORS WHY
skip() {
    report "$1: skipped, $2"
    skipped=1
    [ "${LITETEX_REQUIRE_THIRD_PARTY:-0}" = 0 ] || failed=1
}
# validate COMMAND...: reports the last line, the result; if the command fails, all lines, which name the problems.
validate() {
    local text
    if ! text=$("$@" 2>&1); then
        failed=1
        report "$text"
        return
    fi
    report "$(tail -n 1 <<<"$text")"
}

# --- tools ---

node_why="" python_why="" browser_why=""
node=$cache/node venv=$cache/venv
if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
    node_why="node and npm are missing"
elif [ "$(node -p 'parseInt(process.versions.node)')" -lt 20 ]; then
    node_why="node 20 or newer is needed, found $(node --version)"
else
    mkdir -p "$node"
    cp "$validators"/*.mjs "$validators"/*.html "$validators"/package*.json "$node/"
    if ! cmp -s "$node/package-lock.json" "$node/installed"; then
        rm -f "$node/installed"
        # One package asks for a newer Node.js than what we use of it needs; npm only warns.
        if (cd "$node" && npm ci --no-audit --no-fund --ignore-scripts --loglevel=error) >"$cache/npm.log" 2>&1; then
            cp "$node/package-lock.json" "$node/installed"
        else
            node_why="npm ci failed, see $cache/npm.log"
        fi
    fi
fi
if ! command -v python3 >/dev/null || ! python3 -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
    python_why="python3 (3.11 or newer) with venv is missing"
elif ! cmp -s "$validators/requirements.txt" "$venv/installed"; then
    rm -rf "$venv"
    if python3 -m venv "$venv" >"$cache/pip.log" 2>&1 \
        && "$venv/bin/pip" install -q --disable-pip-version-check -r "$validators/requirements.txt" >>"$cache/pip.log" 2>&1; then
        cp "$validators/requirements.txt" "$venv/installed"
    else
        python_why="pip failed, see $cache/pip.log"
    fi
fi
if ! command -v chromium chromium-browser google-chrome google-chrome-stable >/dev/null; then
    browser_why="Chromium is missing"
fi
python=$venv/bin/python

# --- files: a sample capture, trained for a few seconds ---

rm -rf "${out:?}/capture" "$out/run" "$out/files" "$out/images"
mkdir -p "$out/files" "$out/images"
"$binary" -q sample "$out/capture" --views 20 --size 240x180 --points 3000 --no-truth --text >/dev/null
"$binary" -q train "$out/capture" -o "$out/run" --device cpu --steps 300 \
    --set density.start=50 --set density.texture-start=100 >/dev/null
files=$out/files
export_as() { # export_as QUALITY FILE...
    "$binary" -q export "$out/run" --no-verify --quality "$1" -o "${@:2}" >/dev/null
}
export_as lossless "$files/lossless.glb" "$files/lossless.gltf" "$files/scene.usda" "$files/scene.usdc" "$files/scene.usdz" "$files/scene.spz"
export_as tiny "$files/tiny.glb"
export_as balanced "$files/balanced.gltf" "$files/scene.ply"
"$binary" -q export "$out/run" --no-verify --mesh -o "$files/balanced.glb" >/dev/null
cp "$files/lossless.glb" "$files/scene.glb"
"$binary" -q export "$out/run" --no-verify --quality lossless --up=0.3,-0.7,0.5 --scale 0.5 \
    -o "$files"/turned.{glb,ply,spz} >/dev/null
"$binary" -q render "$files/scene.ply" --capture "$out/capture" --test --device cpu -o "$out/images/ours" >/dev/null

# --- validators ---

if [ -n "$node_why" ]; then
    skip "gltf-validator; three GLTFLoader; glTF-Transform, gltfpack" "$node_why"
else
    validate node "$node/validator.mjs" "$files/lossless.glb" "$files/balanced.glb" "$files/lossless.gltf" \
        "$files/balanced.gltf" "$files/balanced.mesh.glb" "$files/tiny.glb"
    validate node "$node/loader.mjs" "$files/lossless.glb" "$files/balanced.glb" "$files/tiny.glb"
    validate node "$node/transform.mjs" "$binary" "$files/balanced.glb"
fi
if [ -n "$python_why" ]; then
    skip "usd-core; xatlas, raster; second renderer" "$python_why"
else
    validate "$python" "$validators/usd_files.py" "$files/lossless.glb" "$files"/scene.usd?
    if [ -n "${LITETEX_USD_SAMPLES:-}" ]; then
        samples=("$LITETEX_USD_SAMPLES"/*.usd?)
        validate "$python" "$tests/python/check_usd.py" "$LITETEX_USD_SAMPLES/expected.json" "${samples[@]}"
    fi
    validate "$python" "$validators/packing.py" "$files/balanced.glb" "$files/lossless.gltf"
    # Not third-party, but a renderer written from the specifications alone.
    validate "$python" "$tests/python/run_second.py" "$binary"
fi
if [ -n "$node_why$python_why" ]; then
    skip "splat-transform" "${node_why:-$python_why}"
else
    to_ply() { node "$node/node_modules/@playcanvas/splat-transform/bin/cli.mjs" -q -w "$1" "$2"; }
    for name in scene turned; do
        if text=$(to_ply "$files/$name.ply" "$files/$name.ply.other.ply" 2>&1 \
            && to_ply "$files/$name.spz" "$files/$name.spz.other.ply" 2>&1); then
            validate "$python" "$validators/columns.py" "$files/$name.glb" "$files/$name".{ply,spz}.other.ply "$files/$name.spz"
        else
            failed=1
            report "splat-transform: FAILED: $(tail -n 5 <<<"$text")"
        fi
    done
fi
if [ -n "$node_why$python_why$browser_why" ]; then
    skip "three.js in Chromium" "${node_why:-${python_why:-$browser_why}}"
else
    controls=(mirrored rotations sh-signs)
    wide=("wide=$files/lossless.glb")
    for control in "${controls[@]}"; do wide+=("$control=$files/$control.broken.glb"); done
    node "$node/controls.mjs" "$files/lossless.glb" "${wide[@]:1}"
    render_all() { # render_all SIGMAS NAME=FILE...
        node "$node/browser.mjs" "$1" "$out/capture" "$out/images/ours" "$out/images" "${@:2}" >>"$out/browser.log" 2>&1
    }
    : >"$out/browser.log"
    if render_all shipped "lossless=$files/lossless.glb" "balanced=$files/balanced.glb" && render_all 3.33 "${wide[@]}"; then
        validate "$python" "$validators/images.py" "$out/capture/images" "$out/images/ours" "$out/images" \
            lossless,balanced wide "$(IFS=,; echo "${controls[*]}")"
    else
        failed=1
        report "three.js in Chromium: FAILED: $(tail -n 5 "$out/browser.log")"
    fi
fi

printf '\n== third-party validators\n'
printf '%s\n' "${lines[@]}"
case $failed$skipped in
    00) echo "third-party validators: all passed" ;;
    01) echo "third-party validators: all passed, but some were skipped" ;;
    *) echo "third-party validators: FAILED" ;;
esac
exit "$failed"
