#!/usr/bin/env bash
# Counts lines of code, without blank lines and lines of comment, by part of the project.
#
#   scripts/lines.sh
set -euo pipefail
cd "$(dirname "$0")/.."

count() { # count NAME PATHSPEC...: tracked files of code
    local name=$1
    shift
    git ls-files -z -- "$@" | xargs -0 -r awk -v name="$name" '
        FNR == 1 { comment = FILENAME ~ /\.(rs|wgsl|ts|mjs|glsl)$/ ? "^[[:space:]]*(//|$)" : "^[[:space:]]*(#|$)" }
        $0 !~ comment { lines++ }
        END { printf "%-28s %6d\n", name, lines }'
}
count "product: src" 'src/*.rs'
count "product: exporters/src" 'exporters/src/*.rs'
count "product: shaders" 'shaders/*.wgsl'
count "lab" 'lab/src/*.rs' 'lab/*.py' 'lab/*.sh'
count "product and lab" 'src/*.rs' 'exporters/src/*.rs' 'shaders/*.wgsl' 'lab/src/*.rs' 'lab/*.py' 'lab/*.sh'
count "tests, benches, examples" 'tests/*.rs' 'lab/tests/*.rs' 'benches/*.rs' 'examples/*.rs' 'exporters/tests/*.rs' 'exporters/examples/*.rs' \
    'exporters/fuzz/*.rs'
count "web" 'web/*.ts' 'web/*.mjs' 'web/*.glsl' ':!web/package-lock.json'
count "scripts" 'scripts/*.sh' 'scripts/*.py' 'scripts/*.mjs' 'scripts/device-kit'
