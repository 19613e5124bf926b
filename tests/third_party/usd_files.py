#!/usr/bin/env python3
"""Validates USD with Pixar's library: it must read the same arrays, bit for bit, as the lossless .glb of the scene holds.

    usd_files.py FILE.glb FILE.usda FILE.usdc FILE.usdz

Writes expected.json next to the .glb and runs ../python/check_usd.py.
"""

import json
import os
import subprocess
import sys
import zlib

import numpy as np

from gltf import Gltf


def arrays(path):
    """Number of splats, and the CRC-32 of each array that USD must hold: both formats have y up and the same arrays."""
    file = Gltf(path)
    scales = file.attribute("SCALE")
    flat = np.stack([scales[:, 0], scales[:, 1], np.zeros(len(scales), "<f4")], 1)
    common = {name: file.attribute(attribute) for name, attribute in (
        ("positions", "POSITION"), ("orientations", "ROTATION"), ("opacities", "OPACITY"))}
    common["radiance:sphericalHarmonicsCoefficients"] = file.sh()
    out = {f"{variant}/{name}": values for variant in ("textured", "splat3d") for name, values in common.items()}
    out |= {"textured/scales": flat, "splat3d/scales": scales}
    out["textured/primvars:litetex:sh0"] = file.accessor(file.textures["sh0"])
    out["textured/primvars:litetex:texelSize"] = file.accessor(file.textures["texelSize"])
    return len(scales), {name: zlib.crc32(np.ascontiguousarray(v, "<f4").tobytes()) for name, v in out.items()}


def main():
    glb, *files = sys.argv[1:]
    count, hashes = arrays(glb)
    expected = os.path.join(os.path.dirname(glb), "expected.json")
    with open(expected, "w", encoding="utf-8") as file:
        json.dump({os.path.basename(path): {"count": count, "arrays": hashes} for path in files}, file)
    check = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "python", "check_usd.py")
    sys.exit(subprocess.run([sys.executable, check, expected, *files], check=False).returncode)


if __name__ == "__main__":
    main()
