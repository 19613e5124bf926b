#!/usr/bin/env python3
"""Draws docs/images/quality-by-bytes.svg from lab/results/readme.jsonl: lab/readme/chart.py

A panel per capture: held-out PSNR against the bytes of the file, a line per format. Where PSNR falls as a model grows, which the
exposure of a single photo can do, the panel shows gradient-PSNR instead. Prints what share of the bytes of SOG and SPZ a `.ltgs` file of
equal quality takes, interpolated between the files measured.
"""
import math

import shared

FORMATS = {"ltgs": (".ltgs, textured", "#2a6fdb"), "sog": ("SOG", "#c2571a"), "spz": ("SPZ", "#8a3fb0")}
FIGURES = {"psnr": "PSNR, dB", "grad_psnr": "gradient-PSNR, dB"}
# Of a panel, pixels.
WIDTH, HEIGHT, LEFT, TOP, STRIDE = 300, 230, 56, 44, 400
STYLE = """text{fill:#24292f;font:13px system-ui,sans-serif}.grid{stroke:#d0d7de}
@media(prefers-color-scheme:dark){text{fill:#d6dde6}.grid{stroke:#3d444d}}"""


def points(lines, capture, extension, figure):
    """(bytes, figure) of the files of a format, the smallest first."""
    found = [line for line in lines if (line["capture"], line["format"]) == (capture, extension)]
    return sorted((line["bytes"], line["figures"][figure]) for line in found)


def figure_of(lines, capture):
    """The first figure that rises with size in every format."""
    def rises(figure):
        by_size = [[value for _, value in points(lines, capture, extension, figure)] for extension in FORMATS]
        return all(values == sorted(values) for values in by_size)
    return next(figure for figure in FIGURES if rises(figure))


def panel(lines, capture, at):
    """SVG of a capture; the panels stand side by side."""
    figure = figure_of(lines, capture)
    by_format = {extension: points(lines, capture, extension, figure) for extension in FORMATS}
    sizes, values = zip(*(point for found in by_format.values() for point in found))
    low, high = math.floor(min(values) * 2) / 2, math.ceil(max(values) * 2) / 2
    first, last = math.log(min(sizes) / 1.15), math.log(max(sizes) * 1.15)

    def place(size, value):
        x = LEFT + at * STRIDE + WIDTH * (math.log(size) - first) / (last - first)
        return x, TOP + HEIGHT * (high - value) / (high - low)

    left, bottom = LEFT + at * STRIDE, TOP + HEIGHT
    out = [f'<text x="{left}" y="20" font-weight="600">{capture}: held-out {FIGURES[figure]}</text>']
    for step in range(round((high - low) * 2) + 1):
        value = low + step / 2
        y = place(sizes[0], value)[1]
        if value == round(value):
            out.append(f'<path class="grid" d="M{left} {y:.1f}h{WIDTH}"/>'
                       f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for size in (50_000, 100_000, 200_000, 400_000):
        if first <= math.log(size) <= last:
            x = place(size, low)[0]
            out.append(f'<path class="grid" d="M{x:.1f} {TOP}v{HEIGHT}"/>'
                       f'<text x="{x:.1f}" y="{bottom + 20}" text-anchor="middle">{size // 1000} kB</text>')
    for extension, found in by_format.items():
        label, colour = FORMATS[extension]
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


def legend():
    out = []
    for at, (label, colour) in enumerate(FORMATS.values()):
        x, y = LEFT + at * 150, TOP + HEIGHT + 48
        out.append(f'<path d="M{x} {y}h26" stroke="{colour}" stroke-width="2.5"/><text x="{x + 34}" y="{y + 4}">{label}</text>')
    return out


def main():
    lines = shared.read()
    captures = list(dict.fromkeys(line["capture"] for line in lines))
    width, height = LEFT + STRIDE * (len(captures) - 1) + WIDTH + 20, TOP + HEIGHT + 64
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" role="img" '
           f'aria-label="Held-out quality by bytes of the file"><style>{STYLE}</style>']
    for at, capture in enumerate(captures):
        out += panel(lines, capture, at)
        print(*shares(lines, capture), sep="\n")
    (shared.ROOT / "docs/images/quality-by-bytes.svg").write_text("\n".join([*out, *legend(), "</svg>", ""]))


if __name__ == "__main__":
    main()
