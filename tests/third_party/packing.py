#!/usr/bin/env python3
"""Validates the atlas: an integer raster proves that maps do not overlap, nor come nearer than the border that the file
states, and stay inside their pages. Packing the same charts with xatlas, with as much between them, must take at least as many pages of our size, and fill pages by at least 15 percentage points less,
even at a page size of its own choice.

    packing.py FILE.glb...
"""

import os
import sys

import numpy as np
import xatlas

from gltf import Gltf

# By how much our occupancy must exceed that of xatlas. Measured 0.36, on maps with a mean side of 3.5 texels.
MARGIN = 0.15


def layout(path):
    """Rectangles (x, y, cols, rows) of the maps, their page indices, the page sizes, and the border around maps."""
    file = Gltf(path)
    rects = file.accessor(file.textures["rects"]).astype(np.int64)
    pages = np.zeros(len(rects), np.int64)
    if "pages" in file.textures:
        pages = file.accessor(file.textures["pages"])[:, 0].astype(np.int64)
    used = rects[:, 2] * rects[:, 3] > 0
    sizes = [(page["width"], page["height"]) for page in file.textures["atlas"]]
    return rects[used], pages[used], sizes, file.textures.get("border", 0)


def raster_problems(rects, pages, sizes, border):
    """Rasterises all maps with the border to their left and above; yields those that leave their page, and counts of texels covered more than once."""
    if (pages >= len(sizes)).any():
        yield f"page {pages.max()} of {len(sizes)}"
        return
    for page, (width, height) in enumerate(sizes):
        cover = np.zeros((height, width), np.uint16)
        for x, y, cols, rows in rects[pages == page]:
            if min(x, y) < border or x + cols + border > width or y + rows + border > height:
                yield f"page {page}: ({x}, {y}) + {cols} x {rows} with a border of {border} leaves {width} x {height}"
            cover[max(y - border, 0) : y + rows, max(x - border, 0) : x + cols] += 1
        if (cover > 1).any():
            yield f"page {page}: {(cover > 1).sum()} texels are covered more than once"


def by_xatlas(rects, side, border):
    """Charts, pages and occupancy that xatlas reaches with pages of the given side (0: its own choice) and as much between charts. Its input is one
    quad per map, one unit per texel."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    # Spaced out, so that each quad becomes a chart of its own.
    columns = int(np.ceil(np.sqrt(len(rects))))
    offsets = np.stack(np.divmod(np.arange(len(rects)), columns), 1) * 2.0 * rects[:, 2:4].max()
    uvs = (offsets[:, None] + corners[None] * rects[:, None, 2:4]).reshape(-1, 2).astype(np.float32)
    quads = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    faces = (quads[None] + 4 * np.arange(len(rects), dtype=np.uint32)[:, None, None]).reshape(-1, 3)
    atlas = xatlas.Atlas()
    atlas.add_uv_mesh(uvs, faces)
    chart, pack = xatlas.ChartOptions(), xatlas.PackOptions()
    pack.texels_per_unit, pack.padding, pack.resolution = 1.0, border, side
    atlas.generate(chart, pack)
    texels = (rects[:, 2] * rects[:, 3]).sum()
    return atlas.chart_count, atlas.atlas_count, texels / (atlas.atlas_count * atlas.width * atlas.height)


def main():
    problems, figures = [], []
    for path in sys.argv[1:]:
        name = os.path.basename(path)
        rects, pages, sizes, border = layout(path)
        problems += [f"{name}: {problem}" for problem in raster_problems(rects, pages, sizes, border)]
        ours = (rects[:, 2] * rects[:, 3]).sum() / sum(width * height for width, height in sizes)
        charts, theirs_pages, on_ours = by_xatlas(rects, max(max(size) for size in sizes), border)
        free_charts, _, theirs = by_xatlas(rects, 0, border)
        theirs = max(theirs, on_ours)
        if {charts, free_charts} != {len(rects)}:
            problems.append(f"{name}: xatlas made {charts} and {free_charts} charts of {len(rects)} maps")
        if len(sizes) > theirs_pages or ours < theirs + MARGIN:
            problems.append(f"{name}: {len(sizes)} pages, {ours:.3f} full; xatlas {theirs_pages}, {theirs:.3f}")
        figures.append(f"{len(rects)} maps, pages {len(sizes)}, {100 * ours:.1f} % full (xatlas {theirs_pages}, {100 * theirs:.1f} %)")
        controls = {
            "moved onto another": lambda r: r[1].__setitem__(slice(0, 2), r[0][:2]),
            "one texel too wide": lambda r: r[r[:, 0].argmin()].__setitem__(2, r[r[:, 0].argmin()][2] + 1),
            "beyond its page": lambda r: r[0].__setitem__(0, sizes[0][0] - r[0][2] + 1),
        }
        for control, breach in controls.items():
            broken = rects.copy()
            breach(broken)
            if not list(raster_problems(broken, pages, sizes, border)):
                problems.append(f"{name}: control \"{control}\" was not caught")
    for problem in problems:
        print(f"  xatlas, raster: {problem}")
    print("xatlas, raster: " + (f"FAILED, {len(problems)} problems" if problems else "; ".join(figures) + "; 3 controls caught"))
    sys.exit(1 if problems or len(sys.argv) < 2 else 0)


if __name__ == "__main__":
    main()
