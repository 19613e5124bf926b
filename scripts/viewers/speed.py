"""What an image costs in our package and in other programs, on the same splats and at equal quality:

    speed.py BINARY OUT SAME=RUN EQUAL=RUN     SAME: with textures; EQUAL (not needed): an untextured one of the same test PSNR

Writes OUT/files and OUT/WIDTHxHEIGHT.json for render.mjs; with --table, prints the table of what it measured
(OUT/WIDTHxHEIGHT-DRIVER/report.json).
"""

import json
import statistics
import subprocess
import sys
from pathlib import Path

import jobs

TIMES = 5
SIZES = [(270, 480), (1440, 900)]
DRIVERS = {"swiftshader": "SwiftShader", "gl-egl": "llvmpipe"}
FAST = {"precision": "fast"}
PROGRAMS = [
    ("litetex", "exact, textured", ".ltgs", {}),
    ("litetex", "fast, textured", ".ltgs", FAST),
    ("litetex", "fast on the canvas, textured", ".ltgs", {**FAST, "onCanvas": True}),
    ("litetex", "fast on the canvas, untextured", ".ltgs", {**FAST, "onCanvas": True, "colours": "untextured"}),
    ("spark", "Spark 2.2.0, untextured", ".spz", {}),
    ("playcanvas", "PlayCanvas 2.23, untextured", ".y.ply", {"loader": "ply"}),
    ("playcanvas", "PlayCanvas 2.23 with `litetex/playcanvas`, textured", ".ltgs", {"loader": "litetex"}),
]


def print_table(out, rows):
    columns = [(size, driver) for driver in DRIVERS for size in SIZES]
    heads = [f"{DRIVERS[driver]} {width} x {height}" for (width, height), driver in columns]
    print("| " + " | ".join(["splats", "drawn", *heads]) + " |\n|" + "---|" * (2 + len(heads)))
    for i, (splats, title) in enumerate(rows):
        cells = []
        for (width, height), driver in columns:
            one = json.loads((out / f"{width}x{height}-{driver}/report.json").read_text())[str(i)]
            ms = one.get("cpuMs")
            cells.append(f"{statistics.median(ms):,.0f} ({min(ms):,.0f})" if ms else one["error"])
        print("| " + " | ".join([splats, title, *cells]) + " |")


def main():
    binary, out, *runs = [a for a in sys.argv[1:] if a != "--table"]
    out = Path(out)
    files = out / "files"
    files.mkdir(parents=True, exist_ok=True)
    listed, rows = [], []
    for name, run in (r.split("=", 1) for r in runs):
        summary = json.loads((Path(run) / "summary.json").read_text())
        for program, title, ending, options in PROGRAMS:
            # The untextured scene has no maps to leave out.
            if name == "EQUAL" and title.endswith(" textured"):
                continue
            rows.append((f"{summary['size']['splats']:,}, test PSNR {summary['quality']['psnr']:.2f} dB", title))
            listed.append({"name": str(len(listed)), "program": program, "file": str(files / (name + ending)), "options": options, "times": TIMES})
    if "--table" in sys.argv:
        return print_table(out, rows)
    for name, run in (r.split("=", 1) for r in runs):
        for ending, more in [(".ltgs", []), (".glb", []), (".spz", []), (".y.ply", ["--up", "three"])]:
            command = [binary, "-q", "export", run, "--no-verify", "--force", "--device", "cpu", "-o", str(files / (name + ending)), *more]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for width, height in SIZES:
        for job in listed:
            _, camera = jobs.home_view(Path(job["file"]).with_name(Path(job["file"]).name.split(".")[0] + ".glb"))
            job["camera"] = {**camera, "width": width, "height": height}
        (out / f"{width}x{height}.json").write_text(json.dumps(listed))


if __name__ == "__main__":
    main()
