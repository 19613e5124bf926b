#!/usr/bin/env python3
"""Measures coarse files of large models against fine files of small ones: lab/readme/operating_points.py BINARY CAPTURES WORK

CAPTURES holds the folders `fox` and `bonsai`, WORK keeps runs and files, so that a second call continues. Each capture is trained at
three budgets; each model is exported at several losses and compared with the held-out photos. Where a file of the coarsest steps that
the format has loses less than asked, larger losses give the same file. Writes lab/results/operating-points.jsonl, a line per file.
"""
import json
import sys
from pathlib import Path

from shared import run, write

BUDGETS = [150_000, 300_000, 600_000]
LOSSES = ["0.05dB", "0.1dB", "0.2dB", "0.5dB", "1dB", "2dB"]
CAPTURES = ["fox", "bonsai"]
SETTINGS = ["--max-resolution", "480", "--steps", "1000", "--seed", "1", "--device", "cpu"]


def model(binary, capture, budget, folder):
    """The lossless file of a trained scene, trained unless it is there."""
    file = folder / "lossless.ltgs"
    if not file.exists():
        run(binary, "-q", "train", capture, "-o", folder / "run", "--force", "--budget-params", budget, *SETTINGS)
        run(binary, "-q", "export", folder / "run", file, "--quality", "lossless", "--no-verify", "--device", "cpu")
    return file


def figures(binary, lossless, file, capture):
    """Quality of a file on the held-out photos."""
    verdict = run(binary, "-q", "verify", "--against", lossless, file, "--capture", capture, "--max-loss", "9dB", "--json",
                  "--device", "cpu")
    photos = json.loads(verdict)["verdict"]["on_test_photos"]
    return {"psnr": photos["after"], "grad_psnr": photos["grad_after"]}


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    binary, captures, work = (Path(argument).resolve() for argument in sys.argv[1:])
    lines = []
    for capture in CAPTURES:
        for budget in BUDGETS:
            folder = work / f"{capture}-{budget}"
            lossless = model(binary, captures / capture, budget, folder)
            for loss in LOSSES:
                file = folder / f"{loss}.ltgs"
                run(binary, "-q", "export", lossless, file, "--max-loss", loss, "--no-verify", "--force", "--device", "cpu")
                lines.append({"capture": capture, "budget_params": budget, "max_loss": loss, "bytes": file.stat().st_size,
                              "figures": figures(binary, lossless, file, captures / capture), "settings": SETTINGS})
    write("operating-points.jsonl", lines)


if __name__ == "__main__":
    main()
