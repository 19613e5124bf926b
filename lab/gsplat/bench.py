#!/usr/bin/env python3
"""Trains splats with gsplat (https://docs.gsplat.studio) on a capture, as an outside measure of speed and quality.

    bench.py CAPTURE --kind 2dgs|3dgs --out OUT [--max-resolution 480] [--steps 7000] [--cap 62000] [--seed 42]

The capture is a COLMAP model of one camera without distortion (sparse/0, binary) with its photos in images; every eighth view
is held out. The recipe is that of gsplat's own trainer with its MCMC preset, its schedules scaled to the steps. Only the
training is timed. Writes the held-out views to OUT/views and the photos, at their size and under the same names, to
OUT/photos, for `litetex compare OUT/views OUT/photos`; prints one line of JSON. Needs an NVIDIA GPU and the packages gsplat 1.5.3, torch, numpy,
scipy and Pillow; takes SSIM from fused-ssim, as that trainer does, where it is installed.
"""

import argparse
import json
import math
import random
import struct
import time
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from PIL import Image
from scipy.spatial import cKDTree

import gsplat

try:
    from fused_ssim import fused_ssim
except ImportError:
    fused_ssim = None

DEVICE = "cuda"
PINHOLE = 1
SH_C0 = 0.28209479177387814
FULL_STEPS = 30_000


def area_weights(source, target):
    """[target, source]: shares of the source pixels in each target pixel."""
    scale = source / target
    begin = np.arange(target)[:, None] * scale
    pixel = np.arange(source)[None, :]
    cover = np.minimum(begin + scale, pixel + 1.0) - np.maximum(begin, pixel)
    return torch.from_numpy((np.clip(cover, 0, None) / scale).astype(np.float32))


def matrix(quaternion):
    """The rotation of a quaternion (w, x, y, z)."""
    w, x, y, z = np.array(quaternion) / np.linalg.norm(quaternion)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])


def read_model(folder):
    """The camera's size and intrinsics, the views' names and matrices, the points' positions and colours."""

    def unpack(file, form):
        return struct.unpack("<" + form, file.read(struct.calcsize("<" + form)))

    with open(folder / "cameras.bin", "rb") as file:
        (count,) = unpack(file, "Q")
        _, model, *size = unpack(file, "iiQQ")
        if count != 1 or model != PINHOLE:
            raise SystemExit(f"{folder}: {count} cameras, the first of model {model}; expected one of model {PINHOLE} (PINHOLE)")
        intrinsics = unpack(file, "4d")
    views = {}
    with open(folder / "images.bin", "rb") as file:
        for _ in range(unpack(file, "Q")[0]):
            _, *pose, _ = unpack(file, "i7di")
            name = b"".join(iter(lambda: file.read(1), b"\0")).decode()
            file.seek(24 * unpack(file, "Q")[0], 1)
            views[name] = np.eye(4)
            views[name][:3, :3], views[name][:3, 3] = matrix(pose[:4]), pose[4:]
    points, rgb = [], []
    with open(folder / "points3D.bin", "rb") as file:
        for _ in range(unpack(file, "Q")[0]):
            values = unpack(file, "Q3d3Bd")
            file.seek(8 * unpack(file, "Q")[0], 1)
            points.append(values[1:4])
            rgb.append(values[4:7])
    names = sorted(views)
    return size, intrinsics, names, np.stack([views[name] for name in names]), np.array(points), np.array(rgb)


def load_scene(capture, max_resolution):
    """Photos as bytes on the device, cameras in the normalised frame, points."""
    (photo_w, photo_h), (fx, fy, cx, cy), names, camera_from_world, points, rgb = read_model(capture / "sparse" / "0")
    ratio = min(1.0, max_resolution / max(photo_w, photo_h))
    width, height = round(photo_w * ratio), round(photo_h * ratio)
    wy, wx = area_weights(photo_h, height).to(DEVICE), area_weights(photo_w, width).to(DEVICE)
    images = []
    for name in names:
        photo = np.asarray(Image.open(capture / "images" / name).convert("RGB"))
        assert photo.shape == (photo_h, photo_w, 3), photo.shape
        image = torch.from_numpy(photo.copy()).to(DEVICE)
        if ratio < 1.0:
            planes = image.float().permute(2, 0, 1)
            image = (wy @ planes @ wx.T + 0.5).clamp(0, 255).to(torch.uint8).permute(1, 2, 0).contiguous()
        images.append(image)

    # The world is moved and scaled as gsplat's trainer does (`normalize_world_space`); a rotation changes nothing.
    rotation = camera_from_world[:, :3, :3]
    centres = -np.einsum("nji,nj->ni", rotation, camera_from_world[:, :3, 3])
    ahead = rotation[:, 2, :]
    nearest = centres - (centres * ahead).sum(1, keepdims=True) * ahead
    middle = np.median(nearest, axis=0)
    scale = 1.0 / np.median(np.linalg.norm(centres - middle, axis=1))
    normal = (centres - middle) * scale
    moved = np.tile(np.eye(4), (len(names), 1, 1))
    moved[:, :3, :3] = rotation
    moved[:, :3, 3] = -np.einsum("nij,nj->ni", rotation, normal)
    points = (points - middle) * scale
    extent = float(np.linalg.norm(normal - normal.mean(0), axis=1).max()) * 1.1

    sx, sy = width / photo_w, height / photo_h
    k = np.array([[fx * sx, 0, cx * sx], [0, fy * sy, cy * sy], [0, 0, 1]], dtype=np.float32)
    return {
        "names": names,
        "is_test": [view % 8 == 0 for view in range(len(names))],
        "images": images,
        "camera_from_world": torch.from_numpy(moved.astype(np.float32)).to(DEVICE),
        "k": torch.from_numpy(k).to(DEVICE),
        "points": points.astype(np.float32),
        "rgb": rgb.astype(np.float32) / 255.0,
        "extent": extent,
        "width": width,
        "height": height,
    }


def nearest_distances(points, count=3):
    """Root of the mean squared distance to the nearest points."""
    distance = cKDTree(points).query(points, k=count + 1)[0][:, 1:]
    return np.sqrt((distance.astype(np.float64) ** 2).mean(1)).clip(1e-7)


def make_splats(scene, kind, cap, seed):
    """Splats at the capture's points, at most `cap`, and one Adam for each kind of parameter."""
    rng = np.random.default_rng(seed)
    points, rgb = scene["points"], scene["rgb"]
    if len(points) > cap:
        some = rng.permutation(len(points))[:cap]
        points, rgb = points[some], rgb[some]
    n = len(points)
    scales = torch.from_numpy(np.log(0.1 * nearest_distances(points)).astype(np.float32))[:, None].repeat(1, 3)
    if kind == "2dgs":
        # The third axis is not drawn; this thin, MCMC's noise stays within the splat.
        scales[:, 2] = math.log(1e-8)
    quats = torch.from_numpy(rng.random((n, 4)).astype(np.float32))
    harmonics = torch.zeros(n, 16, 3)
    harmonics[:, 0] = (torch.from_numpy(rgb) - 0.5) / SH_C0
    values = {
        "means": (torch.from_numpy(points), 1.6e-4 * scene["extent"]),
        "scales": (scales, 5e-3),
        "quats": (quats, 1e-3),
        "opacities": (torch.logit(torch.full((n,), 0.5)), 5e-2),
        "sh0": (harmonics[:, :1].contiguous(), 2.5e-3),
        "shN": (harmonics[:, 1:].contiguous(), 2.5e-3 / 20),
    }
    params = torch.nn.ParameterDict({name: torch.nn.Parameter(value.clone()) for name, (value, _) in values.items()})
    params = params.to(DEVICE)
    optimizers = {
        name: torch.optim.Adam([{"params": params[name], "lr": lr, "name": name}], eps=1e-15)
        for name, (_, lr) in values.items()
    }
    return params, optimizers


def draw(kind, params, scene, view, degree):
    """One view `[1, height, width, 3]` on black, and gsplat's notes."""
    raster = gsplat.rasterization_2dgs if kind == "2dgs" else gsplat.rasterization
    result = raster(
        means=params["means"],
        quats=params["quats"],
        scales=torch.exp(params["scales"]),
        opacities=torch.sigmoid(params["opacities"]),
        colors=torch.cat([params["sh0"], params["shN"]], 1),
        viewmats=scene["camera_from_world"][view][None],
        Ks=scene["k"][None],
        width=scene["width"],
        height=scene["height"],
        near_plane=0.01,
        far_plane=1e10,
        sh_degree=degree,
        packed=False,
        render_mode="RGB",
    )
    return result[0], result[-1]


def ssim(image, photo):
    """Mean SSIM over windows inside the image."""
    if fused_ssim:
        return fused_ssim(image, photo, padding="valid")
    at = torch.arange(11, device=image.device, dtype=torch.float32) - 5
    window = torch.exp(-(at**2) / (2 * 1.5**2))
    window /= window.sum()
    stack = torch.cat([image, photo, image * image, photo * photo, image * photo])
    n, c = stack.shape[:2]
    flat = stack.reshape(n * c, 1, *stack.shape[2:])
    flat = F.conv2d(F.conv2d(flat, window.view(1, 1, 1, -1)), window.view(1, 1, -1, 1))
    mx, my, xx, yy, xy = flat.reshape(n, c, *flat.shape[2:]).chunk(5)
    top = (2 * mx * my + 0.01**2) * (2 * (xy - mx * my) + 0.03**2)
    return (top / ((mx**2 + my**2 + 0.01**2) * (xx - mx**2 + yy - my**2 + 0.03**2))).mean()


def order(views, rng):
    """Endlessly all views, each time in another order."""
    while True:
        views = list(views)
        rng.shuffle(views)
        yield from views


def train(args, scene, steps):
    """Trains for `steps` steps."""
    factor = steps / FULL_STEPS
    every = lambda step: max(1, int(step * factor))
    params, optimizers = make_splats(scene, args.kind, args.cap, args.seed)
    strategy = gsplat.MCMCStrategy(
        cap_max=args.cap,
        refine_start_iter=every(500),
        refine_stop_iter=every(25_000),
        refine_every=every(100),
        verbose=False,
    )
    strategy.check_sanity(params, optimizers)
    state = strategy.initialize_state()
    decay = torch.optim.lr_scheduler.ExponentialLR(optimizers["means"], gamma=0.01 ** (1.0 / steps))
    views = order([i for i, held in enumerate(scene["is_test"]) if not held], random.Random(args.seed))
    for step in range(steps):
        view = next(views)
        photo = scene["images"][view][None].float() / 255.0
        degree = min(step // every(1000), 3)
        image, info = draw(args.kind, params, scene, view, degree)
        strategy.step_pre_backward(params=params, optimizers=optimizers, state=state, step=step, info=info)
        loss = 0.8 * F.l1_loss(image, photo)
        loss = loss + 0.2 * (1.0 - ssim(image.permute(0, 3, 1, 2), photo.permute(0, 3, 1, 2).contiguous()))
        loss = loss + 0.01 * torch.sigmoid(params["opacities"]).mean()
        drawn = params["scales"][:, :2] if args.kind == "2dgs" else params["scales"]
        loss = loss + 0.01 * torch.exp(drawn).mean()
        loss.backward()
        for optimizer in optimizers.values():
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
        decay.step()
        with torch.no_grad():
            strategy.step_post_backward(
                params=params, optimizers=optimizers, state=state, step=step, info=info, lr=decay.get_last_lr()[0]
            )
    return params


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--kind", choices=["2dgs", "3dgs"], required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--max-resolution", type=int, default=65_536)
    parser.add_argument("--steps", type=int, default=7000)
    parser.add_argument("--cap", type=int, default=62_000)
    parser.add_argument("--seed", type=int, default=42)
    args = parser.parse_args()

    # SSIM by convolutions loses its variances in TF32.
    torch.backends.cudnn.allow_tf32 = False
    # Relocation empties torch's cache each time, which costs time and serves nothing here.
    torch.cuda.empty_cache = lambda: None
    scene = load_scene(args.capture, args.max_resolution)
    # Kernels are loaded and tuned outside the measured time, relocation included.
    torch.manual_seed(args.seed)
    train(args, scene, min(args.steps, 40))
    torch.cuda.synchronize()
    torch.manual_seed(args.seed)
    started = time.perf_counter()
    params = train(args, scene, args.steps)
    torch.cuda.synchronize()
    secs = time.perf_counter() - started

    folders = [args.out / name for name in ("views", "photos")]
    for folder in folders:
        folder.mkdir(parents=True, exist_ok=True)
    for view, is_test in enumerate(scene["is_test"]):
        if not is_test:
            continue
        with torch.no_grad():
            image = draw(args.kind, params, scene, view, 3)[0][0].clamp(0, 1)
        for folder, pixels in zip(folders, [(image * 255.0 + 0.5).to(torch.uint8), scene["images"][view]]):
            Image.fromarray(pixels.cpu().numpy()).save((folder / scene["names"][view]).with_suffix(".png"))
    splats = len(params["means"])
    print(json.dumps({
        "kind": args.kind,
        "size": f"{scene['width']}x{scene['height']}",
        "steps": args.steps,
        "splats": splats,
        "parameters": splats * (59 if args.kind == "3dgs" else 58),
        "seed": args.seed,
        "secs": round(secs, 3),
        "ssim": "fused-ssim" if fused_ssim else "torch",
        "gsplat": gsplat.__version__,
        "torch": torch.__version__,
        "device": torch.cuda.get_device_name(),
    }))


if __name__ == "__main__":
    main()
