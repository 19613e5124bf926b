#!/usr/bin/env python3
"""Expected pixels of a file's views, computed by the second renderer: expected_images.py FILE > expected.json

Needs Python 3.11 and tests/python/requirements.txt. Colours are in the file's colour space, neither clamped nor rounded
to 8 bits.
"""

import json
import sys

sys.dont_write_bytecode = True

import numpy as np

from second_renderer import read_scene, render

# Grid of the pixels that are listed, spread evenly over each view.
COLUMNS, ROWS = 5, 4


def main():
    scene = read_scene(sys.argv[1])
    views = {}
    for camera in scene.meta["cameras"]:
        image = np.asarray(render(scene, camera), dtype=np.float64)
        height, width = image.shape[:2]
        pixels = []
        for row in range(ROWS):
            for column in range(COLUMNS):
                x, y = (2 * column + 1) * width // (2 * COLUMNS), (2 * row + 1) * height // (2 * ROWS)
                pixels.append({"x": x, "y": y, "rgb": [round(float(v), 9) for v in image[y, x]]})
        mean = [round(float(v), 9) for v in image.reshape(-1, 3).mean(axis=0)]
        views[camera["name"]] = {"width": width, "height": height, "mean": mean, "pixels": pixels}
    json.dump({"views": views}, sys.stdout, indent=1)
    print()


main()
