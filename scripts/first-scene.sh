#!/usr/bin/env bash
# Runs the commands of docs/first-scene.md, as they stand there, on a made video. Needs ffmpeg and pycolmap as the page says.
#
#   scripts/first-scene.sh [FOLDER]
#
# FOLDER, a new temporary one if not given, keeps what they make. Variables:
#   LITETEX  the program (default: target/release/litetex)
#   TIME     adds --time TIME to the training, such as 1m
#   FRAMES   frames of the video (default: 720), a third of which are sharp
#   SIZE     its size (default: 640x480)
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
litetex=$(realpath "${LITETEX:-$root/target/release/litetex}")
folder=${1:-$(mktemp -d)}
mkdir -p "$folder"
cd "$folder"

# The block marked "sh"; those of the installation are marked otherwise.
commands=$(sed -n '/^```sh$/,/^```$/p' "$root/docs/first-scene.md" | grep -v '^```')
[ "$(grep -c '^litetex ' <<<"$commands")" = 3 ] || { echo "error: expected 3 commands, found: $commands" >&2; exit 1; }
if [ -n "${TIME:-}" ]; then
    commands=$(sed "s/^litetex train .*/& --time $TIME/" <<<"$commands")
fi

"$litetex" sample video --video "${FRAMES:-720}" --size "${SIZE:-640x480}"
cp video/video.avi phone.mp4
litetex() { "$litetex" "$@"; }
while read -r command; do
    printf '\n$ %s\n' "$command"
    start=$SECONDS
    eval "$command"
    printf '(%d s)\n' $((SECONDS - start))
done <<<"$commands"

grep -q '<html' desk.html || { echo "error: desk.html is no page" >&2; exit 1; }
printf '\n%s: %d bytes, %d s in all\n' "$folder/desk.html" "$(wc -c <desk.html)" "$SECONDS"
