#!/usr/bin/env bash
# Runs the recipes of docs/batch.md as they stand there.
#
#   scripts/batch-docs.sh parallel FOLDER            the line for GNU parallel, on three made captures, one of them damaged
#   scripts/batch-docs.sh image FOLDER [FILES]       the Dockerfile's RUN lines, in a clean Debian root made in FOLDER
#
# `parallel` runs the program $LITETEX (default: target/release/litetex) with few steps, and needs GNU parallel. `image` needs
# root and debootstrap. FILES is a folder that is copied over the root before, for machines that reach registries only through a
# mirror: etc/apt, root/.cargo/config.toml, certificates. Lines that are done are not repeated when it is called again; with
# LINES=1 only the first one is run. $MIRROR is the Debian mirror (default: http://deb.debian.org/debian).
set -euo pipefail
cd "$(dirname "$0")/.."

fail() { printf 'error: %s\n' "$*" >&2; exit 1; }
needs() { command -v "$1" > /dev/null || fail "$1 is missing: apt-get install $1"; }

# The fenced block of docs/batch.md under a heading.
block() {
    awk -v heading="## $1" '$0 == heading { in_part = 1; next } /^## / { in_part = 0 }
        in_part && /^```/ { in_block = !in_block; next } in_part && in_block' docs/batch.md
}

run_parallel() {
    local folder=$1 program recipe text status=0
    program=$(realpath "${LITETEX:-target/release/litetex}")
    [[ -x $program ]] || fail "$program: build it with cargo build --release, or set LITETEX"
    needs parallel
    recipe=$(block 'GNU parallel')
    [[ $recipe == parallel* ]] || fail "docs/batch.md has no line for GNU parallel"
    mkdir -p "$folder"
    cd "$folder"
    [[ ! -e runs && ! -e captures ]] || fail "$folder: not empty"
    mkdir captures bin
    for name in a b damaged; do
        "$program" sample "captures/$name" --views 6 --size 32x32 --points 60 --no-truth -q
    done
    printf 'no images' > captures/damaged/sparse/0/images.bin
    # The line is run as it stands; only what it calls takes few steps.
    printf '#!/bin/sh\nexec "%s" "$@" --steps 5 --device cpu\n' "$program" > bin/litetex
    chmod +x bin/litetex
    PATH=$PWD/bin:$PATH bash -c "$recipe" || status=$?
    text=$(cat runs/table.md)
    printf '%s\n' "$text"
    ((status > 0)) || fail "parallel succeeded, although a capture is damaged"
    for row in 'a | done' 'b | done' 'damaged | failed'; do
        [[ $text == *"| $row |"* ]] || fail "runs/table.md has no row \"$row\""
    done
    # Once more: nothing is done twice, and the mended capture is trained.
    cp captures/a/sparse/0/images.bin captures/damaged/sparse/0/images.bin
    PATH=$PWD/bin:$PATH bash -c "$recipe" || fail "the line fails on sound captures"
    grep -q '| damaged | done |' runs/table.md || fail "the mended capture is not trained"
    echo 'GNU parallel: passed'
}

run_image() {
    local folder=$1 files=${2:-} release line text number=0 variables=()
    [[ $(id -u) == 0 ]] || fail 'needs root, for chroot'
    needs debootstrap
    release=$(block Docker | sed -n 's/^FROM debian://p')
    [[ -n $release ]] || fail 'docs/batch.md has no FROM debian:RELEASE'
    if [[ ! -e $folder/.made ]]; then
        debootstrap --variant=minbase "$release" "$folder" "${MIRROR:-http://deb.debian.org/debian}"
        touch "$folder/.made"
    fi
    cp -L /etc/resolv.conf "$folder/etc/resolv.conf" || true
    [[ -z $files ]] || cp -a "$files/." "$folder/"
    # COPY . /src, of what is committed.
    mkdir -p "$folder/src"
    git archive HEAD | tar -x -C "$folder/src"
    for name in http_proxy https_proxy no_proxy RUSTUP_DIST_SERVER RUSTUP_UPDATE_ROOT; do
        [[ -z ${!name:-} ]] || variables+=("$name=${!name}")
    done
    # As Docker does; rustup needs it.
    mountpoint -q "$folder/proc" || mount -t proc proc "$folder/proc"
    # shellcheck disable=SC2064
    trap "umount '$(realpath "$folder")/proc'" EXIT
    while read -r line; do
        number=$((number + 1))
        ((number <= ${LINES:-99})) || break
        [[ ! -e $folder/.line-$number ]] || continue
        echo "RUN $line"
        env -i HOME=/root PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin DEBIAN_FRONTEND=noninteractive \
            "${variables[@]}" chroot "$folder" /bin/sh -c "$line" < /dev/null || fail "failed: RUN $line"
        touch "$folder/.line-$number"
    done < <(block Docker | sed -n 's/^RUN //p')
    ((number > 0)) || fail 'docs/batch.md has no RUN lines'
    if ((number <= ${LINES:-99})); then
        text=$(chroot "$folder" litetex --version)
        echo "$text: passed"
    fi
}

case "${1:-} $#" in
    'parallel 2') run_parallel "$2" ;;
    'image 2' | 'image 3') run_image "$2" "${3:-}" ;;
    *) sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
esac
