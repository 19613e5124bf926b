#!/usr/bin/env python3
"""Measures files of a wanted size beside others: lab/readme/sized.py BINARY CAPTURES WORK

CAPTURES holds the folders `fox`, `bonsai`, `flower` and `lego`, WORK keeps runs and files, so that a second call continues. `train
--max-size` makes a `.ltgs` file of each size, with textures and without; untextured scenes become SOG files of about these sizes, and
textured ones `.ltgs` files of quality `tiny`. Each is compared with the held-out photos. Writes lab/results/sized.jsonl, a line
per file, and prints what shares of the bytes of other files those of a wanted size take at equal gradient-PSNR. Needs what measure.py
needs.
"""
import json
import math
import sys
from pathlib import Path

from measure import BUDGETS, SETTINGS, export, score
from shared import run, write

# Wanted bytes, and parameters whose SOG file has about as many.
SIZES = {50_000: 35_500, 100_000: 84_000, 200_000: 178_000, 400_000: 370_000}
CAPTURES = ["fox", "bonsai", "flower", "lego"]
# Kinds of files: policy, extension, and the option that bounds the run by each bound.
KINDS = {
    "sized": ("litetex", "ltgs", "--max-size", SIZES),
    "sized, plain": ("plain", "ltgs", "--max-size", SIZES),
    "SOG": ("plain", "sog", "--budget-params", SIZES.values()),
    "tiny": ("litetex", "ltgs", "--budget-params", BUDGETS),
}


def line(binary, capture, kind, bound, folder):
    """Size, quality and time of a file, whose run is trained unless it is there."""
    policy, extension, option, _ = KINDS[kind]
    summary = folder / "run/summary.json"
    if not summary.exists():
        run(binary, "-q", "train", capture, "-o", folder / "run", "--force", "--policy", policy, option, bound, *SETTINGS)
    file = readable = folder / "run/scene.ltgs"
    if option != "--max-size":
        file, readable = export(binary, folder / "run", extension, folder)
    figures = score(binary, readable, capture, folder)
    return {"capture": capture.name, "kind": kind, "policy": policy, "bound": bound, "bytes": file.stat().st_size,
            "figures": {key: figures[key] for key in ("psnr", "grad_psnr", "ssim_3dgs")},
            "train_cpu_secs": json.loads(summary.read_text())["time"]["train_cpu_secs"], "settings": SETTINGS}


def shares(lines, others):
    """Shares of the bytes of others, interpolated, that files of equal gradient-PSNR take, in ascending order."""
    curve = sorted((line["figures"]["grad_psnr"], math.log(line["bytes"])) for line in others)
    found = []
    for line in lines:
        quality = line["figures"]["grad_psnr"]
        for (low, before), (high, after) in zip(curve, curve[1:]):
            if low <= quality <= high:
                found.append(line["bytes"] / math.exp(before + (after - before) * (quality - low) / (high - low)))
    return sorted(found)


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    binary, captures, work = (Path(argument).resolve() for argument in sys.argv[1:])
    lines = []
    for capture in CAPTURES:
        for kind, (_, _, _, bounds) in KINDS.items():
            for bound in bounds:
                folder = work / f"{capture}-{kind.replace(', ', '-')}-{bound}"
                lines.append(line(binary, captures / capture, kind, bound, folder))
                print(capture, kind, lines[-1]["bytes"], lines[-1]["figures"], flush=True)
    write("sized.jsonl", lines)

    def of(capture, kind):
        return [line for line in lines if (line["capture"], line["kind"]) == (capture, kind)]

    for capture in CAPTURES:
        for kind in ["sized", "sized, plain"]:
            for other in ["tiny", "SOG"]:
                found = " ".join(f"{value:.2f}" for value in shares(of(capture, kind), of(capture, other)))
                print(f"{capture}, {kind}, of {other}: {found or 'of other quality'}")


if __name__ == "__main__":
    main()
