#!/usr/bin/env python3
"""Validates PLY and SPZ with splat-transform: it reads both and writes them as PLY, whose columns are compared with the
values that the formats' definitions give for the lossless .glb.

    columns.py FILE.glb FROM_PLY.ply FROM_SPZ.ply FILE.spz
"""

import gzip
import os
import sys

import numpy as np

from gltf import Gltf

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "python"))
from second_renderer import sh_basis

SH_0 = 0.28209479177387814
SH_REST = 45


def ply(path):
    """Columns of a binary PLY of floats, by name."""
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().split("\n")
    assert "format binary_little_endian 1.0" in lines, lines[1]
    count = next(int(line.split()[-1]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[-1] for line in lines if line.startswith("property float")]
    assert len(names) == sum(line.startswith("property") for line in lines), "properties that are not floats"
    rows = np.frombuffer(body, "<f4", count * len(names)).reshape(count, len(names))
    return {name: rows[:, i].astype(np.float64) for i, name in enumerate(names)}


def product(a, b):
    """Product of the quaternion a with each quaternion of b, wxyz."""
    w, x, y, z = a
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return b @ left.T


def matrix(q):
    """Rotation of a unit quaternion wxyz."""
    w, x, y, z = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def turned_sh(sh, turn):
    """Coefficients (n, k, 3) of the rotated functions, by least squares over random directions."""
    directions = np.random.default_rng(1).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    before, after = (sh_basis(d, sh.shape[1]) for d in (directions, directions @ turn.T))
    new_from_old = np.linalg.lstsq(after, before, rcond=None)[0]
    return np.einsum("jk,nkc->njc", new_from_old, sh)


def expected(path, y_up):
    """Expected columns, with y down as in PLY or up as in SPZ: log scales, logits, quaternions wxyz."""
    file = Gltf(path)
    meta = file.textures["meta"]
    scale, rotation, translation = 1.0, np.array([1.0, 0, 0, 0]), np.zeros(3)
    for name in ("captureFromLocal", "worldFromCapture"):
        if frame := meta.get(name):
            turn = np.array(frame["rotation"], np.float64)
            translation = frame["scale"] * matrix(turn) @ translation + frame["translation"]
            scale, rotation = frame["scale"] * scale, product(turn, rotation[None])[0]
    local = file.attribute("POSITION").astype(np.float64) * [1, -1, -1]
    turn = np.array([1, -1, -1] if y_up else [1, 1, 1])
    out = dict(zip("xyz", (turn * (scale * local @ matrix(rotation).T + translation)).T))
    x, y, z, w = file.attribute("ROTATION").astype(np.float64).T
    turned = product(rotation, np.stack([x, -w, z, -y], 1))
    if y_up:
        turned = product([0, 1, 0, 0], turned)
    out |= {f"rot_{i}": turned[:, i] for i in range(4)}
    scales = file.attribute("SCALE").astype(np.float64)[:, :2] * scale
    out |= {f"scale_{i}": np.log(scales[:, i]) for i in range(2)}
    opacity = np.minimum(file.attribute("OPACITY")[:, 0], np.float32(1 - 2**-24)).astype(np.float64)
    out["opacity"] = np.log(opacity / (1 - opacity))
    sh = file.sh().astype(np.float64)
    # From the data's axes (y up) to y down, rotated, and back to y up for SPZ.
    flip = np.diag([1.0, -1, -1])
    sh = turned_sh(sh, (flip if y_up else np.eye(3)) @ matrix(rotation) @ flip)
    out |= {f"f_dc_{c}": sh[:, 0, c] for c in range(3)}
    rest = np.zeros((len(sh), SH_REST // 3, 3))
    rest[:, : sh.shape[1] - 1] = sh[:, 1:]
    # PLY and SPZ store one channel after the other.
    out |= {f"f_rest_{i}": rest[:, i % 15, i // 15] for i in range(SH_REST)}
    return out


def quaternions(columns):
    q = np.stack([columns[f"rot_{i}"] for i in range(4)], 1)
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def errors(found, wanted, tolerances):
    """Largest error of each kind of column, in units of its tolerance."""
    out = {}
    for name, values in wanted.items():
        kind = name.split("_")[0] if name[0] in "rso" else name.rsplit("_", 1)[0] if "_" in name else "xyz"
        if kind == "rot":
            continue
        if kind == "f_rest":
            kind = "f_rest_1" if int(name.split("_")[-1]) % 15 < 3 else "f_rest_2"
        if name not in found:
            if kind.startswith("f_rest") and not values.any():
                continue
            out[kind] = np.inf
            continue
        tolerance = tolerances[kind]
        limit = tolerance(values) if callable(tolerance) else tolerance
        out[kind] = max(out.get(kind, 0), (np.abs(found[name] - values) / limit).max())
    cosine = np.abs((quaternions(found) * quaternions(wanted)).sum(1)).clip(0, 1)
    out["rot"] = 2 * np.arccos(cosine).max() / tolerances["rot"]
    return out


def opacity_step(logits):
    """Half a quantisation step of 1/255, as a difference of logits."""
    o = 1 / (1 + np.exp(-logits))
    low, high = np.clip(o - 0.51 / 255, 1e-9, 1), np.clip(o + 0.51 / 255, 0, 1 - 1e-9)
    return np.maximum(np.log(high / (1 - high)) - logits, logits - np.log(low / (1 - low)))


def main():
    path, from_ply, from_spz, spz = sys.argv[1:]
    with gzip.open(spz) as file:
        fractional_bits = file.read(14)[13]
    exact = {
        # Rounding of f32, also of logits and logarithms computed in single precision.
        "xyz": lambda v: 1e-6 * np.maximum(1, np.abs(v)), "scale": 2e-6, "rot": 1e-3, "opacity": lambda v: 1e-5 * np.maximum(1, np.abs(v)),
        "f_dc": lambda v: 1e-6 * np.maximum(1, np.abs(v)), "f_rest_1": 1e-6, "f_rest_2": 1e-6,
    }
    coded = {
        "xyz": 0.51 * 2.0**-fractional_bits, "scale": 0.51 / 16, "rot": 5e-3, "opacity": opacity_step,
        "f_dc": 0.51 / 255 / 0.15, "f_rest_1": 0.51 / 128, "f_rest_2": 0.51 / 128,
    }
    problems, figures = [], []
    for name, file, tolerances in (("PLY", from_ply, exact), ("SPZ", from_spz, coded)):
        # splat-transform takes the coordinates of SPZ as they are.
        found, wanted = ply(file), expected(path, y_up=name == "SPZ")
        worst = errors(found, wanted, tolerances)
        problems += [f"{name}: {kind} is off by {e:.3g} times its tolerance" for kind, e in worst.items() if not e <= 1]
        if not (found["scale_2"] < np.minimum(found["scale_0"], found["scale_1"])).all():
            problems.append(f"{name}: the third scale is not the smallest")
        figures.append(f"{name} " + " ".join(f"{kind} {e:.2f}" for kind, e in worst.items()))
        for control in ("x", "scale_0", "opacity", "f_dc_1", "f_rest_2", "f_rest_20", "rot_1"):
            broken = found | {control: np.roll(found[control], 1)}
            if all(e <= 1 for e in errors(broken, wanted, tolerances).values()):
                problems.append(f"{name}: control \"{control} permuted\" was not caught")
    for problem in problems:
        print(f"  splat-transform: {problem}")
    print("splat-transform: " + (f"FAILED, {len(problems)} problems" if problems else
          f"{len(wanted['x'])} splats, errors in units of their tolerances: " + "; ".join(figures) + "; 14 controls caught"))
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
