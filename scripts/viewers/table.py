"""The table of what programs show: table.py OUT IMAGES

Compares OUT/*.png of render.mjs with OUT/ours/ of jobs.py, prints a Markdown table and writes small JPEGs into IMAGES. A negative
control must fail: the images upside down are at least 3 dB farther from ours wherever a program shows the scene.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image

# Below this PSNR a program does not show the scene.
SHOWN_DB = 14.0
QUALITY = 82
HEIGHT = 320


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"), dtype=np.float64) / 255


def psnr(a, b):
    return -10 * np.log10(max(np.mean((a - b) ** 2), 1e-12))


def small(array, path):
    image = Image.fromarray((255 * array).round().astype(np.uint8))
    image.thumbnail((HEIGHT * 2, HEIGHT))
    image.save(path, quality=QUALITY, optimize=True)


def main(out, images):
    images.mkdir(parents=True, exist_ok=True)
    jobs = json.loads((out / "jobs.json").read_text())
    report = json.loads((out / "report.json").read_text())
    print("| program | file | as | PSNR to ours | image |\n|---|---|---|---|---|")
    seen, failures = set(), []
    for job in jobs:
        row, found = job["row"], report.get(job["name"], {"error": "not run", "said": []})
        ours = pixels(next((out / "ours" / row["ours"]).rglob("*.png")))
        if row["ours"] not in seen:
            seen.add(row["ours"])
            small(ours, images / f"ours-{row['ours']}.jpg")
        path = out / f"{job['name']}.png"
        if found["error"] or not path.exists():
            result, link = f"refused: {(found['error'] or 'nothing').splitlines()[0][:120]}", ""
        else:
            image = pixels(path)
            near, turned = psnr(image, ours), psnr(image[::-1, ::-1], ours)
            if image.max() == 0:
                print(f"| {row['program']} | {row['file']} | {row['note']} | nothing | |")
                continue
            if turned > near + 3:
                result = f"upside down ({turned:.1f} dB when turned)"
            else:
                result = f"{near:.1f} dB"
                if near > SHOWN_DB and psnr(image[::-1], ours) > near - 3:
                    failures.append(f"{job['name']}: the image upside down is as near")
            small(image, images / f"{job['name']}.jpg")
            link = f"![{row['program']}, {row['file']}](images/viewers/{job['name']}.jpg)"
        print(f"| {row['program']} | {row['file']} | {row['note']} | {result} | {link} |")
    for failure in failures:
        print(failure, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
