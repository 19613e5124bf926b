#!/usr/bin/env python3
"""Makes hard captures of good ones, as people would take them, and the matrix that benches them.

    scripts/casual_captures.py OUT fox=captures/fox bonsai=captures/bonsai
    litetex-lab bench --config OUT/matrix.toml -o bench/casual

Of each COLMAP capture: every 3rd and every 6th training view ("third", "sixth"), the last fifth of the views held out
("block"), 300 points ("points"), training photos with drifting exposure and white balance ("drift", needs Pillow).
Test views, every 8th but for "block", are listed in test.txt. Views keep their photos and poses.
"""

import argparse
import importlib.util
import random
import shutil
import struct
from pathlib import Path

KINDS = ("third", "sixth", "block", "points", "drift")
TEST_EVERY = 8
POINTS = 300
# Largest change of the exposure in stops, and of the white balance.
STOPS, BALANCE = 0.5, 0.05


def read_images(path):
    """[(fixed bytes before the name, name, [(keypoint bytes, point id)])] of an images.bin."""
    data = path.read_bytes()
    (count,), at, images = struct.unpack_from("<Q", data), 8, []
    for _ in range(count):
        head, at = data[at : at + 64], at + 64
        end = data.index(b"\0", at)
        name, at = data[at:end].decode(), end + 1
        (keypoints,), at = struct.unpack_from("<Q", data, at), at + 8
        points = []
        for k in range(keypoints):
            chunk = data[at + 24 * k : at + 24 * k + 24]
            points.append((chunk, struct.unpack_from("<q", chunk, 16)[0]))
        at += 24 * keypoints
        images.append((head, name, points))
    return images


def read_points(path):
    """{point id: (fixed bytes after the id, [(image id, keypoint)])} of a points3D.bin."""
    data = path.read_bytes()
    (count,), at, points = struct.unpack_from("<Q", data), 8, {}
    for _ in range(count):
        (identifier,), at = struct.unpack_from("<Q", data, at), at + 8
        head, at = data[at : at + 35], at + 35
        (length,), at = struct.unpack_from("<Q", data, at), at + 8
        track = [struct.unpack_from("<ii", data, at + 8 * k) for k in range(length)]
        at += 8 * length
        points[identifier] = (head, track)
    return points


def write_sparse(folder, source, images, points):
    """Writes the model of these images; points seen by fewer than two of them are left out."""
    folder.mkdir(parents=True)
    shutil.copy(source / "cameras.bin", folder)
    ids = {struct.unpack_from("<i", head)[0] for head, _, _ in images}
    kept = {}
    for identifier, (head, track) in points.items():
        track = [entry for entry in track if entry[0] in ids]
        if len({image for image, _ in track}) >= 2:
            kept[identifier] = (head, track)
    out = struct.pack("<Q", len(images))
    for head, name, keypoints in images:
        out += head + name.encode() + b"\0" + struct.pack("<Q", len(keypoints))
        for chunk, point in keypoints:
            out += chunk if point in kept else chunk[:16] + struct.pack("<q", -1)
    (folder / "images.bin").write_bytes(out)
    out = struct.pack("<Q", len(kept))
    for identifier, (head, track) in kept.items():
        out += struct.pack("<Q", identifier) + head + struct.pack("<Q", len(track))
        out += b"".join(struct.pack("<ii", *entry) for entry in track)
    (folder / "points3D.bin").write_bytes(out)


def drift(source, target, rng):
    """Writes a photo with another exposure and white balance, changed in linear light."""
    from PIL import Image

    exposure = 2 ** rng.uniform(-STOPS, STOPS)
    tables = []
    for balance in (1 + rng.uniform(-BALANCE, BALANCE), 1, 1 + rng.uniform(-BALANCE, BALANCE)):
        for value in range(256):
            v = value / 255
            linear = v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4
            linear = min(1.0, linear * exposure * balance)
            v = 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055
            tables.append(round(255 * v))
    Image.open(source).convert("RGB").point(tables).save(target, quality=95, subsampling=0)


def make(out, capture, kind):
    sparse = capture / "sparse/0"
    images = sorted(read_images(sparse / "images.bin"), key=lambda image: image[1])
    points = read_points(sparse / "points3D.bin")
    names = [name for _, name, _ in images]
    test = set(names[-(len(names) // 5) :] if kind == "block" else names[::TEST_EVERY])
    train = [name for name in names if name not in test]
    train = train[:: {"third": 3, "sixth": 6}.get(kind, 1)]
    rng = random.Random(0)
    if kind == "points":
        points = dict(rng.sample(sorted(points.items()), min(POINTS, len(points))))
    write_sparse(out / "sparse/0", sparse, [i for i in images if i[1] in test or i[1] in train], points)
    for name in sorted(test.union(train)):
        target = out / "images" / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if kind == "drift" and name in train:
            drift(capture / "images" / name, target, rng)
        else:
            shutil.copy(capture / "images" / name, target)
    (out / "test.txt").write_text("".join(f"{name}\n" for name in sorted(test)))


def parsed(entry):
    """Name, capture and kinds of an argument; ValueError says what is wrong."""
    name, equals, rest = entry.partition("=")
    path, colon, kinds = rest.partition(":")
    if not (name and equals and path):
        raise ValueError(f"{entry}: expected NAME=CAPTURE[:KIND,...]")
    kinds = kinds.split(",") if colon else KINDS
    unknown = [kind for kind in kinds if kind not in KINDS]
    if unknown:
        raise ValueError(f"{entry}: unknown kind {unknown[0]!r}; expected {', '.join(KINDS)}")
    for file in ("sparse/0/cameras.bin", "sparse/0/images.bin", "sparse/0/points3D.bin", "images"):
        if not (Path(path) / file).exists():
            raise ValueError(f"{path}: {file} is missing; expected a COLMAP capture with a binary model")
    if "drift" in kinds and importlib.util.find_spec("PIL") is None:
        raise ValueError(f'{entry}: "drift" needs Pillow (pip install pillow)')
    return name, Path(path), kinds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder to write into; must not exist")
    parser.add_argument("captures", nargs="+", metavar="NAME=CAPTURE[:KIND,...]")
    arguments = parser.parse_args()
    # The matrix names folders; "bench" may run anywhere.
    out = arguments.out.resolve()
    if out.exists():
        parser.error(f"{out}: exists already")
    try:
        captures = [parsed(entry) for entry in arguments.captures]
    except ValueError as error:
        parser.error(str(error))
    matrix = ['common = ["--max-resolution", "480", "--steps", "1000", "--test-list", "{capture}/test.txt"]']
    matrix += ['eval = ["--worst", "{run}/worst.jpg"]', "seeds = [1]", ""]
    for name, path, kinds in captures:
        for kind in kinds:
            folder = out / f"{name}-{kind}"
            make(folder, path, kind)
            matrix += ["[[scene]]", f'name = "{name} {kind}"', f'path = "{folder}"', ""]
    (out / "matrix.toml").write_text("\n".join(matrix))


main()
