#!/usr/bin/env python3
"""Draws quality by bytes and by seconds from lab/results: lab/readme/chart.py

docs/images/quality-by-bytes.svg from readme.jsonl: a panel per capture, held-out PSNR against the bytes of the file, a line per format.
Where PSNR falls as a model grows, which the exposure of a single photo can do, the panel shows gradient-PSNR instead. Prints what share of
the bytes of SOG and SPZ a `.ltgs` file of equal quality takes, interpolated between the files measured.
docs/images/operating-points.svg from operating-points.jsonl: the same of `.ltgs` files, gradient-PSNR, a line per size of the model.
lab/images/quality-by-seconds.svg from seconds.jsonl: both figures against the CPU seconds of training, a line per program.
"""
import math

import shared

# What a line shows, by the value of a key: its label and colour.
FORMATS = {"ltgs": (".ltgs, textured", "#2a6fdb"), "sog": ("SOG", "#c2571a"), "spz": ("SPZ", "#8a3fb0")}
MODELS = {150_000: ("150,000 parameters", "#2a6fdb"), 300_000: ("300,000", "#c2571a"), 600_000: ("600,000", "#8a3fb0")}
PROGRAMS = {"before": ("before", "#c2571a"), "after": ("after", "#2a6fdb")}
# Keys of the horizontal axis: its ticks, and how they are labelled.
TICKS = {
    "bytes": ([50_000, 100_000, 200_000, 400_000], lambda size: f"{size // 1000} kB"),
    "cpu_secs": ([25, 50, 100, 200], lambda secs: f"{secs} s"),
}
FIGURES = {"psnr": "PSNR, dB", "grad_psnr": "gradient-PSNR, dB"}
# Of a panel, pixels.
WIDTH, HEIGHT, LEFT, TOP, STRIDE, ROW = 300, 230, 56, 44, 400, 310
STYLE = """text{fill:#24292f;font:13px system-ui,sans-serif}.grid{stroke:#d0d7de}
@media(prefers-color-scheme:dark){text{fill:#d6dde6}.grid{stroke:#3d444d}}"""


def points(lines, capture, name, figure, by="bytes"):
    """(key `by`, figure) of what a line of a capture's panel shows, in ascending order."""
    keys = ("format", "budget_params", "program")
    found = [line for line in lines if line["capture"] == capture and name in [line.get(key) for key in keys]]
    return sorted((line[by], line["figures"][figure]) for line in found)


def figure_of(lines, capture):
    """The first figure that rises with size in every format."""
    def rises(figure):
        by_size = [[value for _, value in points(lines, capture, extension, figure)] for extension in FORMATS]
        return all(values == sorted(values) for values in by_size)
    return next(figure for figure in FIGURES if rises(figure))


def panel(lines, capture, place_px, names, figure, by):
    """SVG of a capture, with its corner at a place."""
    by_name = {name: points(lines, capture, name, figure, by) for name in names}
    left, top = place_px[0] + LEFT, place_px[1] + TOP
    sizes, values = zip(*(point for found in by_name.values() for point in found))
    low, high = math.floor(min(values) * 2) / 2, math.ceil(max(values) * 2) / 2
    first, last = math.log(min(sizes) / 1.15), math.log(max(sizes) * 1.15)

    def place(size, value):
        x = left + WIDTH * (math.log(size) - first) / (last - first)
        return x, top + HEIGHT * (high - value) / (high - low)

    bottom = top + HEIGHT
    out = [f'<text x="{left}" y="{top - 24}" font-weight="600">{capture}: held-out {FIGURES[figure]}</text>']
    for step in range(round((high - low) * 2) + 1):
        value = low + step / 2
        y = place(sizes[0], value)[1]
        if value == round(value):
            out.append(f'<path class="grid" d="M{left} {y:.1f}h{WIDTH}"/>'
                       f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    ticks, tick_label = TICKS[by]
    for size in ticks:
        if first <= math.log(size) <= last:
            x = place(size, low)[0]
            out.append(f'<path class="grid" d="M{x:.1f} {top}v{HEIGHT}"/>'
                       f'<text x="{x:.1f}" y="{bottom + 20}" text-anchor="middle">{tick_label(size)}</text>')
    for name, found in by_name.items():
        label, colour = names[name]
        placed = [place(*point) for point in found]
        path = "L".join(f"{x:.1f} {y:.1f}" for x, y in placed)
        dots = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>' for x, y in placed)
        out.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="2.5"/>{dots}')
    return out


def shares(lines, capture):
    """Bytes of a `.ltgs` file over those of each other file of equal quality, where the `.ltgs` files span that quality."""
    figure = figure_of(lines, capture)
    ours = points(lines, capture, "ltgs", figure)
    for extension in FORMATS:
        for size, value in points(lines, capture, extension, figure) if extension != "ltgs" else []:
            for (small, low), (large, high) in zip(ours, ours[1:]):
                if low <= value <= high:
                    equal = small * (large / small) ** ((value - low) / (high - low))
                    yield f"{capture}, {extension}, {size} bytes, {value:.2f} dB: {equal / size:.2f}"


def legend(names, y):
    out = []
    for at, (label, colour) in enumerate(names.values()):
        x = LEFT + at * 190
        out.append(f'<path d="M{x} {y}h26" stroke="{colour}" stroke-width="2.5"/><text x="{x + 34}" y="{y + 4}">{label}</text>')
    return out


def draw(file, label, lines, names, rows, by="bytes"):
    """Writes a chart with a column of panels per capture; `rows` choose their figures from the capture's name."""
    captures = list(dict.fromkeys(line["capture"] for line in lines))
    width, height = LEFT + STRIDE * (len(captures) - 1) + WIDTH + 20, ROW * len(rows) + 28
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" '
           f'aria-label="{label}"><style>{STYLE}</style>']
    for row, figure in enumerate(rows):
        for at, capture in enumerate(captures):
            out += panel(lines, capture, (at * STRIDE, row * ROW), names, figure(capture), by)
    (shared.ROOT / file).write_text("\n".join([*out, *legend(names, height - 16), "</svg>", ""]))


def main():
    lines = shared.read("readme.jsonl")
    for capture in dict.fromkeys(line["capture"] for line in lines):
        print(*shares(lines, capture), sep="\n")
    draw("docs/images/quality-by-bytes.svg", "Held-out quality by bytes of the file", lines, FORMATS,
         [lambda capture: figure_of(lines, capture)])
    draw("docs/images/operating-points.svg", "Held-out quality of files of models of three sizes", shared.read("operating-points.jsonl"),
         MODELS, [lambda _: "grad_psnr"])
    draw("lab/images/quality-by-seconds.svg", "Held-out quality by CPU seconds of training", shared.read("seconds.jsonl"), PROGRAMS,
         [lambda _: "psnr", lambda _: "grad_psnr"], "cpu_secs")


if __name__ == "__main__":
    main()
