#!/usr/bin/env python3
"""Measures stand-ins: lab/readme/stand_ins.py BINARY WORK

WORK is the folder of `sized.py`, with runs of 300,000 parameters. Exports each in quality `tiny` with `--preview` and without. Writes
lab/results/stand-ins.jsonl: bytes of both files, size and PSNR of the stand-in against the scene, bytes of the scene with which that looks
better, and CPU seconds of both exports.
"""
import json
import os
import sys
from pathlib import Path

from shared import run, write

CAPTURES = ["fox", "flower", "bonsai"]
PARAMS = 300_000


def export(binary, source, file, *options):
    """What the program says of a file, and the CPU seconds that it took."""
    def spent():
        times = os.times()
        return times.children_user + times.children_system
    before = spent()
    said = run(binary, "-q", "export", source, "-o", file, "--quality", "tiny", "--device", "cpu", "--force", "--json", *options)
    return json.loads(said)["files"][0], spent() - before


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    binary, work = (Path(argument).resolve() for argument in sys.argv[1:])
    lines = []
    for capture in CAPTURES:
        source = work / f"{capture}-tiny-{PARAMS}" / "run"
        file = work / f"{capture}-stand-in.ltgs"
        _, plain_secs = export(binary, source, file)
        plain_bytes = file.stat().st_size
        written, secs = export(binary, source, file, "--preview")
        lines.append({"capture": capture, "bytes": plain_bytes, "bytes_with": file.stat().st_size, "stand_in": written["stand_in"],
                      "cpu_secs": round(plain_secs, 1), "cpu_secs_with": round(secs, 1)})
        print(lines[-1])
    write("stand-ins.jsonl", lines)


if __name__ == "__main__":
    main()
