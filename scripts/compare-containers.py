#!/usr/bin/env python3
"""Compares file formats on finished runs: scripts/compare-containers.py BINARY RUN...

Exports each run as `.ltgs` (balanced, tiny), SPZ and PLY, converts the PLY to SOG with splat-transform (npx, at the
version of tests/third_party) and back, and renders every file from the held-out views. Prints a row of a Markdown table
per run: bytes of each file and PSNR on the test photos.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

PINNED = json.loads((Path(__file__).parent / "../tests/third_party/package.json").read_text())["dependencies"]
SPLAT_TRANSFORM = "@playcanvas/splat-transform"


def run(*command, fails=(0,)):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode not in fails:
        sys.exit(f"error: {' '.join(map(str, command))}: exit code {done.returncode}\n{done.stderr}")
    return done.stdout


def splat_transform(*paths):
    run("npx", "--yes", f"{SPLAT_TRANSFORM}@{PINNED[SPLAT_TRANSFORM]}", "-w", "-g", "cpu", *paths)


def test_psnr(binary, run_dir, file):
    """PSNR on the test photos of the scene and of the file, dB."""
    # SPZ exceeds the limits of its quality on purpose: exit code 1 is a result here.
    report = json.loads(run(binary, "verify", file, "--against", run_dir, "--json", fails=(0, 1)))
    photos = report["on_test_photos"] if "on_test_photos" in report else report["verdict"]["on_test_photos"]
    return photos["before"], photos["after"]


def row(binary, run_dir, folder):
    cells = []
    for name, quality in [("balanced.ltgs", "balanced"), ("tiny.ltgs", "tiny"), ("splats.spz", None), ("splats.ply", None)]:
        file = folder / name
        run(binary, "export", run_dir, "--out", file, *(["--quality", quality] if quality else []))
        if name == "splats.ply":
            sog, back = folder / "splats.sog", folder / "back.ply"
            splat_transform(file, sog)
            splat_transform(sog, back)
            measured, rendered = sog, back
        else:
            measured, rendered = file, file
        before, after = test_psnr(binary, run_dir, rendered)
        cells.append((measured.stat().st_size, after))
    # Files without textures are compared with the untextured scene: the scene's own figure comes from a textured file.
    scene, _ = test_psnr(binary, run_dir, folder / "balanced.ltgs")
    return f"| {run_dir.name} | {scene:.2f} dB | " + " | ".join(f"{size / 1e3:.0f} kB, {psnr:.2f} dB" for size, psnr in cells) + " |"


def main():
    if len(sys.argv) < 3:
        sys.exit("usage: scripts/compare-containers.py BINARY RUN...")
    binary = Path(sys.argv[1]).resolve()
    print("| Run | scene | `.ltgs` balanced | `.ltgs` tiny | SPZ | SOG |\n|---|---|---|---|---|---|", flush=True)
    for run_dir in map(Path, sys.argv[2:]):
        with tempfile.TemporaryDirectory() as folder:
            print(row(binary, run_dir, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
