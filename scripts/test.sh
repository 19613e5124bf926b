#!/usr/bin/env bash
# Everything that must hold before a change is merged. Needs a Rust tool chain (rustup) and a C++
# compiler (the FLIP metric); installs what else it can. The test summaries come last.
set -euo pipefail
cd "$(dirname "$0")/.."

note() { printf '\n== %s\n' "$*"; }
fail() { printf 'error: %s\n' "$*" >&2; exit 1; }

note "tools"
command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.95 or newer from https://rustup.rs"
for component in rustfmt clippy; do
    cargo "${component/rustfmt/fmt}" --version >/dev/null 2>&1 \
        || rustup component add "$component" \
        || fail "$component is missing: rustup component add $component"
done
if ! command -v "${CXX:-c++}" >/dev/null; then
    if command -v apt-get >/dev/null && [ "$(id -u)" = 0 ]; then
        apt-get install -y --no-install-recommends g++
    else
        fail "no C++ compiler (c++): install g++ or clang"
    fi
fi
cargo --version

# Each configuration once, in the order from quick to slow.
features=("" "--no-default-features")

note "format"
cargo fmt --all --check

note "dependencies of the exporters"
tree=$(cargo tree -p litetex-exporters --edges normal --prefix none)
if grep -E '^(wgpu|clap|litetex-gs) ' <<<"$tree"; then
    fail "litetex-exporters must not depend on wgpu, clap or litetex-gs"
fi

note "licences"
if command -v cargo-deny >/dev/null; then
    cargo deny check licenses
else
    echo "skipped: cargo-deny is not installed (cargo install --locked cargo-deny)"
fi

for set in "${features[@]}"; do
    note "clippy ${set:-(default features)}"
    # shellcheck disable=SC2086 # an empty set is no argument
    cargo clippy --workspace --all-targets $set -- -D warnings
done

note "documentation"
RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --document-private-items

for set in "${features[@]}"; do
    note "tests ${set:-(default features)}"
    # shellcheck disable=SC2086
    cargo test --workspace $set
done
