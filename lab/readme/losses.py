#!/usr/bin/env python3
"""Measures what each kind of file loses on held-out photos: lab/readme/losses.py BINARY WORK

Exports the run of the fox with 300,000 parameters that measure.py left, and writes lab/results/readme-losses.jsonl, a line per file:
PSNR of the scene and of the file on the photos, and of what programs without textures show of it.
"""
import json
import sys
from pathlib import Path

import shared

RUN = "fox-litetex-300000/run"
FILES = [("html", "balanced"), ("ltgs", "tiny"), ("glb", "balanced"), ("usdz", "balanced"), ("ply", None), ("spz", None)]


def main():
    binary, work = (Path(argument).resolve() for argument in sys.argv[1:])
    scene = json.loads((work / RUN / "summary.json").read_text())
    lines = []
    for extension, quality in FILES:
        file = work / f"loss.{extension}"
        options = ["--quality", quality] if quality else []
        shared.run(binary, "-q", "export", work / RUN, "-o", file, "--force", "--device", "cpu", *options)
        # Files that exceed the limits of their quality, as those without textures may: exit code 1.
        printed = shared.run(binary, "verify", file, "--against", work / RUN, "--json", "--device", "cpu", codes=(0, 1))
        photos = json.loads(printed)["verdict"]["on_test_photos"]
        lines.append({"file": extension, "quality": quality, "bytes": file.stat().st_size, "scene_psnr": scene["quality"]["psnr"],
                      "psnr": photos["after"], "psnr_without_textures": photos["fallback"], "version": scene["version"]})
        print(lines[-1], flush=True)
    shared.write("readme-losses.jsonl", lines)


if __name__ == "__main__":
    main()
