"""What an image costs in our package and in other programs, on the same splats and at equal quality:

    speed.py BINARY OUT SAME=RUN EQUAL=RUN     SAME: with textures; EQUAL: an untextured one of the same test PSNR

Writes OUT/files and OUT/speed.json for render.mjs; with --table, prints the table of what it measured (OUT/report.json).
"""

import json
import statistics
import subprocess
import sys
from pathlib import Path

import jobs

TIMES = 12
PROGRAMS = [
    ("litetex", "this package", ".ltgs", {}, "textured"),
    ("litetex", "this package", ".ltgs", {"colours": "untextured"}, "untextured"),
    ("three", "three.js r187, add-on", ".glb", {"loader": "gltf", "output": "linear"}, "untextured"),
    ("spark", "Spark 2.2.0", ".spz", {}, "untextured"),
    ("playcanvas", "PlayCanvas 2.23", ".y.ply", {"loader": "ply"}, "untextured"),
]


def main():
    table = "--table" in sys.argv
    binary, out, *runs = [a for a in sys.argv[1:] if a != "--table"]
    files = Path(out) / "files"
    files.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, run in (r.split("=", 1) for r in runs):
        for program, title, ending, options, how in PROGRAMS:
            # The untextured scene has no maps to leave out.
            if not (name == "EQUAL" and program == "litetex" and options):
                rows.append((name, run, program, title, files / (name + ending), options, how if name == "SAME" else "untextured"))
    if table:
        report = json.loads((Path(out) / "report.json").read_text())
        print("| splats | program | drawn | ms an image, median (least) |\n|---|---|---|---|")
        for i, (name, run, _, title, _, _, how) in enumerate(rows):
            summary = json.loads((Path(run) / "summary.json").read_text())
            splats, psnr = summary["size"]["splats"], summary["quality"]["psnr"]
            ms = report[str(i)]["ms"]
            said = f"{statistics.median(ms):.0f} ({min(ms):.0f})" if ms else report[str(i)]["error"]
            print(f"| {splats:,}, test PSNR {psnr:.2f} dB | {title} | {how} | {said} |")
        return
    for name, run in (r.split("=", 1) for r in runs):
        for ending, more in [(".ltgs", []), (".glb", []), (".spz", []), (".y.ply", ["--up", "three"])]:
            command = [binary, "-q", "export", run, "--no-verify", "--force", "--device", "cpu", "-o", str(files / (name + ending)), *more]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    listed = []
    for i, (name, _, program, _, file, options, _) in enumerate(rows):
        _, camera = jobs.home_view(files / (name + ".glb"))
        listed.append({"name": str(i), "program": program, "file": str(file), "options": options, "camera": camera, "times": TIMES})
    (Path(out) / "speed.json").write_text(json.dumps(listed))


if __name__ == "__main__":
    main()
