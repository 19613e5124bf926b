#!/usr/bin/env python3
"""Compares the program with the second renderer on the conformance scene, and checks the second reader of `.ltgs`.

    run_second.py LITETEX [FOLDER]

LITETEX: the program. FOLDER: output of `cargo run -p litetex-exporters --example conformance -- FOLDER`; without it, the
scene is written to a temporary folder, by `examples/conformance` next to the program or else by cargo.

Every file and view must agree to 60 dB (final values, peak 1, not clamped; measured 124 dB and more). Every negative
control, which breaks one rule of the specification, must stay below its limit, usually 55 dB. Prints the figures; exits
with 1 if any check fails.
Needs Python 3.11 and tests/python/requirements.txt. Takes about 45 s, plus a build if cargo has to make the scene.
"""

import dataclasses
import glob
import os
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True

import numpy as np

from coder_vectors import check_coder, check_layers
from second_renderer import (
    KHR,
    TEXTURE,
    Gltf,
    Rules,
    Scene,
    decoded,
    linear_from_srgb,
    psnr,
    read_reference,
    read_scene,
    render,
)

AGREE_DB = 60.0
CONTROL_DB = 55.0
# For rules that affect too few pixels to fall below 60 dB; still far below the 130 dB of the correct image.
FINE_CONTROL_DB = 90.0
VIEWS = ("wide", "side", "inside")
FILES = {
    "lossless.glb": VIEWS,
    "balanced.glb": VIEWS,
    "lossless.usda": VIEWS,
    "balanced.usdz": VIEWS,
    "linear.glb": ("wide",),
    "opaque.glb": ("wide",),
    "lossless.gltf": ("wide",),
    "balanced.usdc": ("wide",),
    "lossless.ltgs": VIEWS,
    "tiny.ltgs": ("wide",),
    "tiny.glb": ("wide",),
}
# Files that the program makes from lossless.glb, in the folder of the images.
CONVERTED = ("lossless.ltgs", "tiny.ltgs", "tiny.glb")


def make_scene(program, folder):
    """Writes the conformance scene in all formats."""
    built = os.path.join(os.path.dirname(os.path.abspath(program)), "examples", "conformance")
    root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
    cargo = ["cargo", "run", "-q", "-p", "litetex-exporters", "--example", "conformance", "--", folder]
    subprocess.run([built, folder] if os.path.exists(built) else cargo, cwd=root, check=True)


def convert(program, folder, out):
    """Writes the files that are made from lossless.glb."""
    for name in CONVERTED:
        paths = [os.path.join(folder, "lossless.glb"), os.path.join(out, name)]
        command = [program, "convert", *paths, "--quality", name.split(".")[0], "--no-verify", "--quiet"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def program_image(program, path, view, is_linear, folder):
    """The program's render of a view: final values in the space of the asset, linear light or not."""
    out = os.path.join(folder, f"{os.path.basename(path)}-{view}")
    command = [program, "render", path, "--view", view, "--exr", "--device", "cpu", "--quiet", "--out", out]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    (image,) = glob.glob(os.path.join(out, "*.exr"))
    return read_reference(image, is_linear)


def worked_example():
    """Largest difference from the pixels printed in gltf.md, section 11."""
    texels = [[(0.5, 0, 0), (0, 0.5, 0), (0, 0, 0.5)], [(0.25, 0.25, 0), (0, 0.25, 0.25), (-0.5, 0, 0.25)]]
    sh = [(0.5, 0, -1), (0.25, 0.5, 0), (0, 0.25, 0.5), (0.5, 0, 0.25)]
    camera = {"widthPx": 64, "heightPx": 48, "focalPx": [100, 100], "principalPx": [32, 24]}
    camera |= {"rotationRows": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "translation": [0, 0, 0]}
    scene = Scene(
        positions=np.array([[0.25, -0.125, -2]]),
        rotations=np.array([[0, 0.6, 0, 0.8]]),
        sigmas=np.array([[0.25, 0.125]]),
        opacities=np.array([0.75]),
        sh=np.array([sh]),
        rects=np.array([[0, 0, 3, 2]]),
        page_of=np.array([0]),
        degrees=np.array([1]),
        texel_sizes=np.array([[0.25, 0.25]]),
        shifts=np.array([[0, 0]]),
        pages=[np.array(texels)],
        meta={"near": 0.0625, "background": [0.125, 0.25, 0.5]},
    )
    pixels = [
        ("none", (0.25, 0.25), (0, 0), (42, 31), [0.378194, 0.469383, 0.248918]),
        ("ewa", (0.25, 0.25), (0, 0), (42, 31), [0.377117, 0.468451, 0.249986]),
        ("ewa", (0.0625, 0.0625), (0, 0), (43, 31), [0.463840, 0.384705, 0.171114]),
        ("none", (0.125, 0.25), (-3, 1), (42, 31), [0.492846, 0.440880, 0.261408]),
        ("ewa", (0.0625, 0.015625), (-3, 2), (43, 31), [0.479376, 0.354334, 0.171114]),
    ]
    errors = []
    for name, sizes, shift, (x, y), pixel in pixels:
        changed = {"texel_sizes": np.array([sizes]), "shifts": np.array([shift])}
        image = render(dataclasses.replace(scene, meta=scene.meta | {"filter": name}, **changed), camera)
        errors.append(np.abs(image[y, x] - pixel).max())
    return max(errors)


def shifted(scene):
    """Every rectangle shifted by one column."""
    rects = scene.rects.copy()
    widths = np.array([page.shape[1] for page in scene.pages])[scene.page_of]
    rects[:, 0] += np.where(rects[:, 0] + rects[:, 2] < widths, 1, -1) * (rects[:, 2] > 0)
    return dataclasses.replace(scene, rects=rects)


def reversed_splats(scene):
    """Splats in reverse order, which only affects splats of equal depth."""
    names = ("positions", "rotations", "sigmas", "opacities", "sh", "degrees", "rects", "page_of", "texel_sizes", "shifts")
    return dataclasses.replace(scene, **{name: getattr(scene, name)[::-1] for name in names})


def texels_changed(scene, change):
    """The scene with `change` applied to every map."""
    pages = [page.copy() for page in scene.pages]
    for (x, y, cols, rows), page in zip(scene.rects, scene.page_of):
        part = pages[page][y : y + rows, x : x + cols]
        part[...] = change(part.copy())
    return dataclasses.replace(scene, pages=pages)


def controls(folder):
    """Yields (violation, file, scene, rules, limit in dB); the image must differ from the program's."""
    lossless, balanced, opaque = "lossless.glb", "balanced.glb", "opaque.glb"
    scene, codes, stacks = (read_scene(os.path.join(folder, name)) for name in (lossless, balanced, opaque))
    gltf = Gltf(os.path.join(folder, balanced))
    primitive = gltf.json["meshes"][0]["primitives"][0]
    decode = primitive["extensions"][KHR]["extensions"][TEXTURE]["decode"]

    def decoded_as_srgb(texels):
        code = (texels - decode["bias"]) / decode["scale"]
        return decoded(255 * linear_from_srgb(code / 255), decode["scale"], decode["bias"])

    averaged = scene.sh.copy()
    averaged[:, 0] = gltf.accessor(primitive["attributes"][f"{KHR}:SH_DEGREE_0_COEF_0"])
    black = scene.meta | {"background": [0.0, 0.0, 0.0]}
    close = scene.meta | {"near": 0.5 * scene.meta["near"]}
    unfiltered = scene.meta | {"filter": "none"}
    broken_scenes = {
        "rectangles shifted by one column": shifted(scene),
        "quaternions read as wxyz": dataclasses.replace(scene, rotations=scene.rotations[:, [3, 0, 1, 2]]),
        "maps mirrored along u": texels_changed(scene, lambda texels: texels[::-1]),
        "maps mirrored along v": texels_changed(scene, lambda texels: texels[:, ::-1]),
        "texel size of u for both axes": dataclasses.replace(scene, texel_sizes=scene.texel_sizes[:, [0, 0]]),
        "no shifts": dataclasses.replace(scene, shifts=0 * scene.shifts),
        "shifts in whole texels": dataclasses.replace(scene, shifts=2 * scene.shifts),
        "shifts to the other side": dataclasses.replace(scene, shifts=-scene.shifts),
        "shifts of u and v swapped": dataclasses.replace(scene, shifts=scene.shifts[:, ::-1]),
        "no maps": dataclasses.replace(scene, rects=0 * scene.rects),
        "DC with the map's mean": dataclasses.replace(scene, sh=averaged),
        "degrees 0 and 1 only": dataclasses.replace(scene, sh=scene.sh[:, :4]),
        "splats of equal depth reversed": reversed_splats(scene),
        "black background": dataclasses.replace(scene, meta=black),
        "half the near plane": dataclasses.replace(scene, meta=close),
    }
    broken_rules = {
        "map clamped at its edge": Rules(map_edge="edge"),
        "frame mirrored in x": Rules(data_to_local=(-1.0, -1.0, -1.0)),
        "frame mirrored in y": Rules(data_to_local=(1.0, 1.0, -1.0)),
        "pixel centres at integers": Rules(pixel_centre=0.0),
        "order by distance": Rules(order="distance"),
        "cut at 3 sigma": Rules(cut_sigma=3.0),
    }
    fine_rules = {"base not clamped": Rules(base_min=-np.inf), "no early stop": Rules(stop_below=0.0)}
    for violation, broken in broken_scenes.items():
        yield violation, lossless, broken, Rules(), CONTROL_DB
    for violation, rules in broken_rules.items():
        yield violation, lossless, scene, rules, CONTROL_DB
    yield "no low-pass filter", lossless, dataclasses.replace(scene, meta=unfiltered), Rules(), FINE_CONTROL_DB
    fine_rules["footprint of one texel"] = Rules(footprint_max=1.0)
    for violation, rules in fine_rules.items():
        yield violation, lossless, scene, rules, FINE_CONTROL_DB
    yield "atlas decoded as sRGB", balanced, texels_changed(codes, decoded_as_srgb), Rules(), CONTROL_DB
    yield "0.99 not rounded to f32", opaque, stacks, Rules(alpha_max=0.99), FINE_CONTROL_DB


def check_pages(folder, out):
    """Yields differences between containers of the scene: arrays must be equal, 8-bit texels within half a step."""
    first = read_scene(os.path.join(folder, "lossless.glb"))
    for name in ("lossless.gltf", "lossless.usda", "lossless.ltgs"):
        scene = read_scene(os.path.join(out if name in CONVERTED else folder, name))
        for field in ("positions", "rotations", "sigmas", "opacities", "sh", "degrees", "texel_sizes", "shifts"):
            if not np.array_equal(getattr(first, field), getattr(scene, field)):
                yield f"{name}: {field} differ from lossless.glb"
        if any((map_of(first, k) != map_of(scene, k)).any() for k in range(len(first.rects))):
            yield f"{name}: texels differ from lossless.glb"
    for name in ("balanced.glb", "balanced.usdc", "balanced.usdz"):
        scene = read_scene(os.path.join(folder, name))
        error = max(np.abs(map_of(first, k) - map_of(scene, k)).max(initial=0.0) for k in range(len(first.rects)))
        # Residuals in [-1, 1], rounded to at least 254 steps.
        if not 0 < error <= 1.001 / 254:
            yield f"{name}: texels differ by {error}"
    if len(first.pages) < 3:
        yield f"{len(first.pages)} atlas pages, expected at least 3"


def map_of(scene, splat):
    """The texture map of a splat, (rows, cols, 3)."""
    x, y, cols, rows = scene.rects[splat]
    return scene.pages[scene.page_of[splat]][y : y + rows, x : x + cols]


def check(program, folder, out):
    """Prints all figures; yields the problems."""
    error = worked_example()
    print(f"worked example of the specification: {error:.1e}")
    if error > 1e-6:
        yield f"worked example: the pixel differs by {error:.1e}"
    convert(program, folder, out)
    yield from check_pages(folder, out)
    yield from check_coder()
    yield from check_layers()
    references = {}
    for name, views in FILES.items():
        path = os.path.join(out if name in CONVERTED else folder, name)
        scene = read_scene(path)
        for view in views:
            references[name, view] = program_image(program, path, view, scene.is_linear, out)
            found = psnr(render(scene, scene.camera(view)), references[name, view])
            print(f"{name:14} {view:7} {found:7.2f} dB")
            if not found >= AGREE_DB:
                yield f"{name} {view}: {found:.2f} dB"
    for violation, name, scene, rules, limit in controls(folder):
        found = psnr(render(scene, scene.camera("wide"), rules), references[name, "wide"])
        print(f"control: {violation:34} {found:7.2f} dB")
        if not found < limit:
            yield f"control \"{violation}\" was not caught: {found:.2f} dB"


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    program = sys.argv[1]
    if os.path.exists(program):
        program = os.path.abspath(program)
    with tempfile.TemporaryDirectory() as out:
        folder = sys.argv[2] if len(sys.argv) > 2 else out
        if len(sys.argv) < 3:
            make_scene(program, folder)
        start = time.monotonic()
        problems = list(check(program, folder, out))
    for problem in problems:
        print(f"WRONG: {problem}")
    print(f"second renderer: {time.monotonic() - start:.0f} s, {len(problems)} problems")
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
