#!/usr/bin/env bash
# Every check that must pass before a change is merged: formatting, lints, licences, documentation, tests, the web package
# (scripts/web.sh), and third-party validation of exported files (scripts/third-party.sh). Ends with the total of all tests.
#
# Needs a Rust tool chain (rustup) and a C compiler, and installs the rest if it can. The tests of the GPU
# backend run on software drivers: Mesa's lavapipe, and the SwiftShader that ships with Chromium. Without a driver they
# print that they are skipped.
#
#   scripts/test.sh [--quick]
#
# --quick, for everyday work: formatting, lints of the default features, and all tests that build without the feature gpu.
set -euo pipefail
cd "$(dirname "$0")/.."

note() { printf '\n== %s\n' "$*"; }
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

case ${1:-} in
    "") ;;
    --quick)
        note "format"
        cargo fmt --all --check
        note "clippy"
        cargo clippy --workspace --all-targets -- -D warnings
        note "tests without the feature gpu"
        exec cargo test --workspace --no-default-features
        ;;
    *) fail "$1: no such option; usage: scripts/test.sh [--quick]" ;;
esac

note "tools"
command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.95 or newer from https://rustup.rs"
for component in rustfmt clippy; do
    cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 \
        || rustup component add "$component" \
        || fail "$component is missing: rustup component add $component"
done
install() { # install PACKAGE...: as root, where there is apt-get
    command -v apt-get >/dev/null && [ "$(id -u)" = 0 ] || return 1
    if compgen -G "/var/lib/apt/lists/*_Packages*" >/dev/null; then
        apt-get install -y --no-install-recommends "$@" && return
    fi
    apt-get update && apt-get install -y --no-install-recommends "$@"
}
if ! command -v "${CC:-cc}" >/dev/null; then
    install gcc || fail "no C compiler (cc): install gcc or clang"
fi
cargo --version

note "graphics drivers"
# Chromium bundles a loader that other programs cannot use.
loader() { find /usr/lib* /usr/local/lib -maxdepth 2 -name libvulkan.so.1 -not -path '*chrom*' 2>/dev/null; }
lavapipe() { find /usr/share/vulkan/icd.d -name 'lvp_icd*.json' 2>/dev/null; }
layer() { find /usr/share/vulkan/explicit_layer.d -name 'VkLayer_khronos_validation.json' 2>/dev/null; }
browser() { command -v chromium || command -v chromium-browser || command -v google-chrome; }
swiftshader() {
    find /usr/lib*/chromium* /opt/google/chrome -maxdepth 1 -name vk_swiftshader_icd.json 2>/dev/null | sed -n 1p
}
node_js() { command -v node; }
node_npm() { command -v npm; }
venv() { python3 -c 'import venv, ensurepip; print("there")' 2>/dev/null; }
# The function that finds it, its package, and what is skipped without it.
needs=(
    "loader libvulkan1 all tests on a GPU driver"
    "lavapipe mesa-vulkan-drivers the tests on lavapipe"
    "layer vulkan-validationlayers the run under the validation layer"
    "browser chromium compiling the kernels in a browser, images of the web package"
    "swiftshader chromium the tests on SwiftShader"
    "node_js nodejs the web package, third-party validation of glTF, PLY and SPZ"
    "node_npm npm the web package, third-party validation of glTF, PLY and SPZ"
    "venv python3-venv third-party validation of USD and the atlas"
)
for need in "${needs[@]}"; do
    read -r what package skipped <<<"$need"
    if [ -z "$($what)" ] && { ! install "$package" || [ -z "$($what)" ]; }; then
        echo "skipped: $skipped ($what is missing; package $package)"
    fi
done
# Environment of the tests with the feature gpu: where the drivers are, and which tests must not be skipped.
gpu_env=(XDG_RUNTIME_DIR="$(mktemp -d)")
trap 'rm -rf "${gpu_env[0]#*=}"' EXIT
icd=$(swiftshader || true) # find fails where a folder is missing
if [ -n "$icd" ]; then
    gpu_env+=(VK_ADD_DRIVER_FILES="$icd")
fi
if [ -n "$(loader)" ] && [ -n "$(lavapipe)" ] && [ -n "$icd" ] && [ -n "$(layer)" ]; then
    gpu_env+=(LITETEX_REQUIRE_GPU=2)
fi
if [ -n "$(browser)" ] && [ -n "$icd" ]; then
    gpu_env+=(LITETEX_REQUIRE_BROWSER=1)
fi
# USD samples, written by the tests for the third-party validators.
usd_samples=$PWD/target/third-party/usd
rm -rf "$usd_samples"
mkdir -p "$usd_samples"
gpu_env+=(LITETEX_USD_SAMPLES="$usd_samples")
printf '%s\n' "${gpu_env[@]}"

note "format"
cargo fmt --all --check

note "dependencies among the crates"
names() { cargo tree -p "$1" --edges normal --prefix none | grep -oE '^(wgpu|clap|litetex-[a-z]+) ' | sort -u | tr -d '\n'; }
[ "$(names litetex-exporters)" = "litetex-exporters " ] || fail "litetex-exporters must not depend on wgpu, clap or another crate of this workspace"
case $(names litetex-gs) in
    *litetex-lab*) fail "litetex-gs must not depend on litetex-lab" ;;
esac

note "licences and sources of dependencies"
# Unoptimised: built in a minute, runs in seconds.
cargo_deny=$(command -v cargo-deny || echo "$PWD/target/tools/bin/cargo-deny")
[ -x "$cargo_deny" ] || cargo install --locked --debug --root target/tools cargo-deny@0.20.2
"$cargo_deny" check licenses bans sources

for set in "" "--no-default-features"; do
    note "clippy ${set:-(default features)}"
    # shellcheck disable=SC2086 # an empty set is no argument
    cargo clippy --workspace --all-targets $set -- -D warnings
done

note "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items

results=${gpu_env[0]#*=}/results
note "tests (default features)"
env "${gpu_env[@]}" cargo test --workspace | tee -a "$results"
# What the feature changes: the program, its messages and its devices. All other code is the same as above.
note "tests --no-default-features"
cargo test --package litetex-gs --no-default-features --bins --test cli --test cli_render --test train_cpu | tee -a "$results"

note "web package"
binary=${CARGO_TARGET_DIR:-target}/debug/litetex
assets=${CARGO_TARGET_DIR:-target}/web-assets
mkdir -p "$assets"
cargo run --quiet --example conformance --package litetex-exporters -- "$assets"
env "${gpu_env[@]}" scripts/web.sh "$binary" "$assets" | tee -a "$results"

note "third-party validation of exported files"
LITETEX_USD_SAMPLES="$usd_samples" scripts/third-party.sh "$binary"

note "total of all tests"
awk '/^test result: / { passed += $4; failed += $6; ignored += $8; binaries++ }
    END { printf "test result: ok. %d passed; %d failed; %d ignored; in %d binaries\n", passed, failed, ignored, binaries }' \
    "$results"
