#!/usr/bin/env python3
"""Compares file formats on finished runs: scripts/compare-containers.py [--chart FILE.svg] BINARY RUN...

Exports each run as `.ltgs` (balanced, tiny), SPZ and PLY, converts the PLY to SOG with splat-transform (npx, at the
version of tests/third_party) and back, and renders every file from the held-out views. Prints a row of a Markdown table
per run: bytes of each file and PSNR on the test photos. With --chart it also draws them, with a line for each format and policy.
"""
import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

PINNED = json.loads((Path(__file__).parent / "../tests/third_party/package.json").read_text())["dependencies"]
SPLAT_TRANSFORM = "@playcanvas/splat-transform"
FORMATS = [".ltgs balanced", ".ltgs tiny", "SPZ", "SOG"]
COLOURS = ["#2a6fdb", "#0b8a5a", "#c2571a", "#8a3fb0"]


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


def measure(binary, run_dir, folder):
    """PSNR of the scene, and (bytes, PSNR) of a file in each of FORMATS."""
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
    return scene, cells


def chart(lines):
    """SVG of PSNR over bytes; `lines`: lists of (bytes, PSNR) by (format, policy)."""
    points = [point for line in lines.values() for point in line]
    sizes, psnrs = zip(*points)
    low, high = math.floor(min(psnrs)), math.ceil(max(psnrs))
    first, last = math.log10(min(sizes) / 1.1), math.log10(max(sizes) * 1.1)

    def place(size, psnr):
        return 50 + 530 * (math.log10(size) - first) / (last - first), 350 - 320 * (psnr - low) / (high - low)

    out = ['<svg xmlns="http://www.w3.org/2000/svg" width="760" height="400" viewBox="0 0 760 400" font-family="sans-serif" '
           'font-size="12"><rect width="760" height="400" fill="#fff"/>']
    for psnr in range(low, high + 1):
        y = place(sizes[0], psnr)[1]
        out.append(f'<path d="M50 {y:.1f}H580" stroke="#ddd"/><text x="44" y="{y + 4:.1f}" text-anchor="end">{psnr}</text>')
    for size in (s * 10**e for e in range(3, 8) for s in (1, 2, 5) if first <= math.log10(s * 10**e) <= last):
        x = place(size, low)[0]
        out.append(f'<path d="M{x:.1f} 30V350" stroke="#ddd"/><text x="{x:.1f}" y="368" text-anchor="middle">{size / 1e3:g} kB</text>')
    out.append('<text x="12" y="18">Test PSNR, dB</text><text x="315" y="390" text-anchor="middle">File, bytes (log scale)</text>')
    for k, ((name, policy), line) in enumerate(lines.items()):
        colour = COLOURS[FORMATS.index(name)]
        style = f'stroke="{colour}" fill="none" stroke-width="2"' + ("" if policy == "litetex" else ' stroke-dasharray="6 4"')
        path = "M" + "L".join("{:.1f} {:.1f}".format(*place(*point)) for point in sorted(line))
        dots = "".join('<circle cx="{:.1f}" cy="{:.1f}" r="3" fill="{}"/>'.format(*place(*point), colour) for point in line)
        y = 40 + 20 * k
        out.append(f'<path d="{path}" {style}/>{dots}<path d="M595 {y}h30" {style}/><text x="632" y="{y + 4}">{policy}, {name}</text>')
    return "\n".join([*out, "</svg>", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--chart", type=Path, metavar="FILE.svg")
    parser.add_argument("binary", type=Path, metavar="BINARY")
    parser.add_argument("runs", type=Path, metavar="RUN", nargs="+")
    arguments = parser.parse_args()
    print(f"| Run | scene | {' | '.join(FORMATS)} |\n|---|---|---|---|---|---|", flush=True)
    lines = {}
    for run_dir in arguments.runs:
        policy = json.loads((run_dir / "summary.json").read_text())["policy"]
        with tempfile.TemporaryDirectory() as folder:
            scene, cells = measure(arguments.binary.resolve(), run_dir, Path(folder))
        print(f"| {run_dir.name} | {scene:.2f} dB | " + " | ".join(f"{size / 1e3:.0f} kB, {psnr:.2f} dB" for size, psnr in cells) + " |",
              flush=True)
        for name, cell in zip(FORMATS, cells):
            lines.setdefault((name, policy), []).append(cell)
    if arguments.chart:
        arguments.chart.write_text(chart(lines))


if __name__ == "__main__":
    main()
