#!/usr/bin/env python3
"""Measures the files that the README compares: lab/readme/measure.py BINARY CAPTURES WORK

CAPTURES holds the folders `fox` and `flower`, WORK keeps runs and files, so that a second call continues. Each capture is trained
with and without textures at three budgets. Textured scenes become `.ltgs` files of quality `tiny`; untextured ones, which are
better where maps are lost, become SPZ files and, by way of PLY and splat-transform, SOG files; SOG is converted back to be rendered.
Every file is rendered from the held-out views and compared with the photos. Writes lab/results/readme.jsonl, a line per file.

Needs Node.js 20 with npm, and the Python packages of tests/third_party/requirements.txt named numpy and pillow.
"""
import functools
import json
import sys
from pathlib import Path

import photos
from shared import ROOT, run, write

BUDGETS = [75_000, 150_000, 300_000]
CAPTURES = ["fox", "flower"]
SIZE_PX = 480
SETTINGS = ["--max-resolution", str(SIZE_PX), "--steps", "1000", "--seed", "1", "--device", "cpu"]
PACKAGE = "@playcanvas/splat-transform"
PINNED = json.loads((ROOT / "tests/third_party/package.json").read_text())["dependencies"][PACKAGE]
# What is made of a scene of each policy.
FORMATS = {"litetex": ["ltgs"], "plain": ["sog", "spz"]}
# What is kept of the summary of a run.
KEPT = ["version", "device", "capture", "seed", "steps", "profile", "policy", "quality", "size", "time"]


def splat_transform(source, target):
    run("npx", "--yes", f"{PACKAGE}@{PINNED}", "-w", "-g", "cpu", source, target)


def train(binary, capture, policy, budget, folder):
    """The finished run of a capture, trained unless it is there."""
    summary = folder / "summary.json"
    if not summary.exists():
        run(binary, "-q", "train", capture, "-o", folder, "--force", "--policy", policy, "--budget-params", budget, *SETTINGS)
    return json.loads(summary.read_text())


def with_filter(binary, plain, folder):
    """The splats of a PLY file, which cannot say so, with the low-pass filter that they were trained with."""
    file = folder / "filtered.gltf"
    run(binary, "-q", "export", plain, "-o", file, "--quality", "lossless", "--no-verify", "--force", "--device", "cpu")
    text = file.read_text()
    if text.count('"filter":"none"') != 1:
        sys.exit(f"error: {file}: found no filter to set")
    file.write_text(text.replace('"filter":"none"', '"filter":"ewa"'))
    return file


def export(binary, run_folder, extension, folder):
    """Writes the scene of a run in a format; returns that file, and one with the same splats that litetex renders."""
    file = folder / f"scene.{extension}"
    if extension == "sog":
        plain, back = folder / "scene.ply", folder / "back.ply"
        # The way back loses what the file says of its frame: keep the capture's, whose cameras render it.
        run(binary, "-q", "export", run_folder, "-o", plain, "--force", "--device", "cpu", "--up=-y:-y")
        splat_transform(plain, file)
        splat_transform(file, back)
        return file, with_filter(binary, back, folder)
    quality = ["--quality", "tiny"] if extension == "ltgs" else []
    run(binary, "-q", "export", run_folder, "-o", file, "--force", "--device", "cpu", *quality)
    return file, file


@functools.cache
def held_out(binary, capture):
    """Photos of the held-out views by the names of their renders, and the longer side of those renders in pixels."""
    said = json.loads(run(binary, "inspect", capture, "--json"))
    folder = capture / "images" if said["format"] == "colmap" else capture
    longest = max(int(side) for size in said["sizes"] for side in size.split("x"))
    return {Path(view).with_suffix(".png"): folder / view for view in said["test_views"]}, min(longest, SIZE_PX)


def score(binary, file, capture, folder):
    """Quality figures of a file on the photos of the held-out views, which are written into `folder` as well."""
    renders, targets = folder / f"{file.stem}-{file.suffix[1:]}", folder / "photos"
    views, size_px = held_out(binary, capture)
    run(binary, "-q", "render", file, "--capture", capture, "--test", "--size", size_px, "-o", renders, "--force", "--device", "cpu")
    photos.write_like(views, renders, targets)
    figures = json.loads(run(binary, "compare", renders, targets, "--json", "--device", "cpu"))
    # Without the folders that were compared.
    return {key: value for key, value in figures.items() if key not in ("a", "b")}


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    binary, captures, work = (Path(argument).resolve() for argument in sys.argv[1:])
    lines = []
    for name in CAPTURES:
        for policy, formats in FORMATS.items():
            for budget in BUDGETS:
                folder = work / f"{name}-{policy}-{budget}"
                summary = train(binary, captures / name, policy, budget, folder / "run")
                for extension in formats:
                    file, readable = export(binary, folder / "run", extension, folder)
                    figures = score(binary, readable, captures / name, folder)
                    scene = {key: summary[key] for key in KEPT}
                    scene["capture"]["path"] = f"captures/{name}"
                    lines.append({"capture": name, "policy": policy, "budget_params": budget, "format": extension,
                                  "bytes": file.stat().st_size, "figures": figures, "settings": SETTINGS, "scene": scene})
    write("readme.jsonl", lines)


if __name__ == "__main__":
    main()
