#!/usr/bin/env bash
# Tables what AMD's code for the kernels is like, without a GPU (lab/examples/amd_code.rs).
#
# Needs Mesa's Vulkan drivers (Debian's mesa-vulkan-drivers) and the loader (libvulkan1).
#
#   scripts/amd-code.sh [FILE.wgsl]...
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
driver=$(find /usr/share/vulkan/icd.d -name 'radeon_icd*.json' 2>/dev/null | sed -n 1p)
if [ -z "$driver" ]; then
    echo "error: RADV is missing: install mesa-vulkan-drivers" >&2
    exit 1
fi
export RADV_FORCE_FAMILY=${RADV_FORCE_FAMILY:-navi21} VK_DRIVER_FILES=$driver VK_ICD_FILENAMES=$driver
exec cargo run --quiet --manifest-path "$root/Cargo.toml" --package litetex-lab --example amd_code -- "$@"
