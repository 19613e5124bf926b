#!/usr/bin/env python3
"""Draws docs/images/compare.jpg from what measure.py left: lab/readme/image.py WORK

The first held-out photo of the fox, the same view of the `.ltgs` file, and of the SOG file of nearest size.
"""
import sys
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

import shared

CAPTURE, OURS = "fox", ("litetex", 300_000)
# Part of the view, as shares of its sides; how much it is enlarged; pixels between the panels.
CROP = (0.0, 0.14, 1.0, 0.86)
ZOOM = 2
GAP_PX = 8


def panel(path, label):
    """Part of an image under its label."""
    image = Image.open(path).convert("RGB")
    image = image.crop(tuple(round(share * side) for share, side in zip(CROP, image.size * 2)))
    image = image.resize((image.width * ZOOM, image.height * ZOOM), Image.BICUBIC)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(26)
    left, top, right, bottom = draw.textbbox((14, 10), label, font=font)
    draw.rectangle((left - 8, top - 6, right + 8, bottom + 6), fill=(16, 18, 22))
    draw.text((14, 10), label, font=font, fill=(236, 238, 242))
    return image


def main():
    work = Path(sys.argv[1])
    lines = [line for line in shared.read("readme.jsonl") if line["capture"] == CAPTURE]
    ours = next(line for line in lines if (line["policy"], line["budget_params"]) == OURS)
    theirs = min((line for line in lines if line["format"] == "sog"), key=lambda line: abs(line["bytes"] - ours["bytes"]))
    name = ours["figures"]["per_view"][0]["name"]
    folders = [work / f"{CAPTURE}-{line['policy']}-{line['budget_params']}" for line in (ours, theirs)]
    panels = [
        panel(folders[0] / "photos" / name, "photo, held out"),
        panel(folders[0] / "scene-ltgs" / name, f"litetex, {ours['bytes'] / 1e3:.0f} kB"),
        panel(folders[1] / "filtered-gltf" / name, f"SOG, {theirs['bytes'] / 1e3:.0f} kB"),
    ]
    width, height = panels[0].size
    whole = Image.new("RGB", (3 * width + 2 * GAP_PX, height), "white")
    for at, image in enumerate(panels):
        whole.paste(image, (at * (width + GAP_PX), 0))
    whole.save(shared.ROOT / "docs/images/compare.jpg", quality=88, subsampling=0)
    print(f"{name}: {whole.width} x {whole.height} pixels")


if __name__ == "__main__":
    main()
