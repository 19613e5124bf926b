#!/usr/bin/env python3
"""Compares the poses that `litetex capture` found with the true ones, or with those of another capture. Needs NumPy.

    litetex sample video --video 720 --size 640x480
    litetex capture video/video.avi -o capture --frames 240
    scripts/compare_poses.py capture video/truth/poses.json
    scripts/compare_poses.py capture other-capture/sparse/0/images.bin

Aligns the found cameras with the true ones by a similarity (Umeyama), and prints as JSON the photos with a pose, the median
and largest errors of direction and of position (as a share of the extent of the true cameras), and how many blurred frames
were chosen. Photos of another capture are found by name. Exits with 1 if the medians exceed 0.5 degrees or 1 %, fewer than
90 % have a pose, or a blurred frame is there.
"""

import json
import re
import struct
import sys
from pathlib import Path

import numpy as np


def read_images(path):
    """{name: (rotation, translation)} of camera_from_capture, of an images.bin."""
    data = path.read_bytes()
    (count,), at, images = struct.unpack_from("<Q", data), 8, {}
    for _ in range(count):
        w, x, y, z, *translation = struct.unpack_from("<7d", data, at + 4)
        end = data.index(b"\0", at + 64)
        name = data[at + 64 : end].decode()
        (points,) = struct.unpack_from("<Q", data, end + 1)
        at = end + 9 + 24 * points
        rotation = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        images[name] = np.array(rotation), np.array(translation)
    return images


def similarity(found, true):
    """Scale, rotation and translation that map the found positions to the true ones best."""
    mean_found, mean_true = found.mean(0), true.mean(0)
    a, b = found - mean_found, true - mean_true
    u, s, vt = np.linalg.svd(b.T @ a / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    rotation = u @ sign @ vt
    scale = (s @ np.diag(sign)) / (a**2).sum(1).mean()
    return scale, rotation, mean_true - scale * rotation @ mean_found


def read_truth(path, names):
    """{name: (rotation, translation, whether it is blurred)} of camera_from_capture, of those of these photos that have one."""
    if path.suffix == ".bin":
        return {name: (*pose, False) for name, pose in read_images(path).items() if name in names}
    frames = json.loads(path.read_text())["frames"]
    of = {name: frames[int(re.search(r"(\d+)\D*$", name)[1])] for name in names}
    rows = lambda f: (np.array(f["camera_from_capture_rows"]), np.array(f["translation"]), f["blurred"])
    return {name: rows(frame) for name, frame in of.items()}


def main():
    capture = Path(sys.argv[1])
    images = read_images(capture / "sparse/0/images.bin")
    photos = [path.name for path in (capture / "images").iterdir()]
    truth = read_truth(Path(sys.argv[2]), photos)
    names = sorted(name for name in images if name in truth)
    rows = [truth[name][0] for name in names]
    true_centres = np.array([-truth[name][0].T @ truth[name][1] for name in names])
    centres = np.array([-images[name][0].T @ images[name][1] for name in names])
    scale, turn, shift = similarity(centres, true_centres)
    extent = np.linalg.norm(true_centres.max(0) - true_centres.min(0))
    position = np.linalg.norm(scale * centres @ turn.T + shift - true_centres, axis=1) / extent
    relative = [images[name][0] @ turn.T @ r.T for name, r in zip(names, rows)]
    angle = np.degrees([np.arccos(np.clip((np.trace(m) - 1) / 2, -1, 1)) for m in relative])
    blurred = sum(blurred for *_, blurred in truth.values())
    share = len(images) / len(photos)
    print(
        json.dumps(
            {
                "photos": len(photos),
                "registered": len(images),
                "compared": len(names),
                "median_error_deg": float(np.median(angle)),
                "largest_error_deg": float(angle.max()),
                "median_error_of_extent": float(np.median(position)),
                "largest_error_of_extent": float(position.max()),
                "blurred": blurred,
            },
            indent=2,
        )
    )
    good = share >= 0.9 and np.median(angle) <= 0.5 and np.median(position) <= 0.01 and blurred == 0
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
