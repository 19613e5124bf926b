#!/usr/bin/env python3
"""A second renderer of assets, written from their specifications alone.

It shares no code with the program. Its only sources are `gltf.md`, `usd.md` and `ltgs.md` in `exporters/schema`; comments
cite their sections. It evaluates the formulas in f64, splat by splat, as the text states them. If the program and this
file render the same image, the specifications describe what the program does.

    second_renderer.py FILE.glb|.gltf|.ltgs|.usda|.usdc|.usdz --view NAME [-o OUT.npy] [--compare IMAGE.exr]

OUT.npy holds f32 (height, width, 3) in the space of the asset, not clamped. `--compare` prints the PSNR against an image
written by `litetex render --exr`. Needs numpy; for USD usd-core; for .ltgs xxhash, zstandard.
"""

import argparse
import base64
import json
import math
import os
import struct
import sys
import zipfile
from dataclasses import dataclass
from urllib.parse import unquote

import numpy as np

from second_images import read_exr, read_png

KHR = "KHR_gaussian_splatting"
TEXTURE = "LITETEX_gaussian_splatting_texture"
Y_0 = 0.28209479177387814
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass
class Scene:
    """An asset in the frame of its data (right-handed, y up); arrays are f64 with one row per splat."""

    positions: np.ndarray  # (n, 3)
    rotations: np.ndarray  # (n, 4), xyzw
    sigmas: np.ndarray  # (n, 2), along u and v
    opacities: np.ndarray  # (n,)
    sh: np.ndarray  # (n, k, 3), degree 0 exact
    degrees: np.ndarray  # (n,), SH degrees: coefficients above them do not count
    rects: np.ndarray  # (n, 4), x, y, cols, rows in texels
    page_of: np.ndarray  # (n,)
    texel_sizes: np.ndarray  # (n, 2), along u and v
    shifts: np.ndarray  # (n, 2), half texels from the splat's centre to the map's
    pages: list  # residuals, each (height, width, 3)
    meta: dict  # gltf.md, section 8

    @property
    def is_linear(self):
        """Whether final values are linear light."""
        return self.meta["colourSpace"] == "lin_rec709_display"

    def camera(self, name):
        """The stored camera with this name."""
        named = [c for c in self.meta["cameras"] if c["name"] == name]
        if not named:
            sys.exit(f"no camera {name}; there are {[c['name'] for c in self.meta['cameras']]}")
        return named[0]


# ---------------------------------------------------------------------------------------------------------------- files


def decoded(codes, scale, bias):
    """Texels from 8-bit codes (gltf.md, section 3)."""
    texels = codes.astype(np.float64) * scale + bias
    return np.clip(texels.astype(np.float32).astype(np.float64), -1.0, 1.0)


def checked(data, reference, hashes):
    """Bytes of a sidecar file, if they are those that were written with the file that refers to them (gltf.md, section 9)."""
    if reference in hashes:
        import xxhash

        found = xxhash.xxh3_64_hexdigest(data)
        assert found == hashes[reference].lower(), f"{reference}: hash {found}, expected {hashes[reference]}: another export"
    return data


class Gltf:
    """A glTF container: JSON, buffers, accessors, images."""

    def __init__(self, path):
        self.folder = os.path.dirname(path)
        with open(path, "rb") as file:
            data = file.read()
        self.embedded, self.hashes = b"", {}
        if data[:4] != b"glTF":
            self.json = json.loads(data)
            return
        version, length = struct.unpack_from("<II", data, 4)
        assert version == 2 and length == len(data), "not a GLB of version 2"
        at = 12
        while at < length:
            size, kind = struct.unpack_from("<I4s", data, at)
            content = data[at + 8 : at + 8 + size]
            if kind == b"JSON":
                self.json = json.loads(content)
            elif kind == b"BIN\0":
                self.embedded = content
            at += 8 + size

    def file(self, uri):
        """Bytes behind a URI: embedded data or a file relative to this one."""
        if uri.startswith("data:"):
            return base64.b64decode(uri.split(",", 1)[1])
        with open(os.path.join(self.folder, unquote(uri)), "rb") as file:
            return checked(file.read(), uri, self.hashes)

    def view(self, index):
        """Bytes of a buffer view."""
        view = self.json["bufferViews"][index]
        buffer = self.json["buffers"][view["buffer"]]
        data = self.file(buffer["uri"]) if "uri" in buffer else self.embedded
        start = view.get("byteOffset", 0)
        return data[start : start + view["byteLength"]]

    def accessor(self, index):
        """Values of an accessor, (count, components), f64 or i64."""
        accessor = self.json["accessors"][index]
        assert "sparse" not in accessor, "sparse accessor"
        width, kind = WIDTHS[accessor["type"]], np.dtype(COMPONENTS[accessor["componentType"]])
        stride = self.json["bufferViews"][accessor["bufferView"]].get("byteStride", width * kind.itemsize)
        data = self.view(accessor["bufferView"])[accessor.get("byteOffset", 0) :]
        rows = np.ndarray((accessor["count"], width), kind, data, 0, (stride, kind.itemsize))
        return rows.astype(np.float64) if kind.kind == "f" else rows.astype(np.int64)

    def image(self, texture):
        """Bytes of the image behind a core texture."""
        image = self.json["images"][self.json["textures"][texture]["source"]]
        return self.view(image["bufferView"]) if "bufferView" in image else self.file(image["uri"])

    def page(self, page, decode):
        """Residuals of an atlas page (section 3)."""
        shape = (page["height"], page["width"], 3)
        if "bufferView" in page:
            texels = np.frombuffer(self.view(page["bufferView"]), "<f4").astype(np.float64).reshape(shape)
        elif "uri" in page:
            texels = read_exr(self.file(page["uri"]))
        else:
            texels = decoded(read_png(self.image(page["texture"])), decode["scale"], decode["bias"])
        assert texels.shape == shape, f"page of {texels.shape}, expected {shape}"
        return texels


def read_gltf(path):
    """Reads the scene of a .glb or .gltf (sections 1 to 3)."""
    gltf = Gltf(path)
    primitives = [p for mesh in gltf.json["meshes"] for p in mesh["primitives"] if KHR in p.get("extensions", {})]
    assert len(primitives) == 1, f"{len(primitives)} primitives with splats, expected one"
    attributes = primitives[0]["attributes"]
    textured = primitives[0]["extensions"][KHR]["extensions"][TEXTURE]
    assert textured["version"] == 3, "unknown version"
    gltf.hashes = textured.get("sidecars", {})
    if "stream" in textured:
        return read_stream(gltf.view(textured["stream"]["bufferView"]), textured, len(gltf.accessor(attributes["POSITION"])))

    def attribute(name):
        return gltf.accessor(attributes[f"{KHR}:{name}"])

    names = [f"SH_DEGREE_{l}_COEF_{n}" for l in range(4) for n in range(2 * l + 1)]
    sh = np.stack([attribute(n) for n in names if f"{KHR}:{n}" in attributes], axis=1)
    if "sh0" in textured:
        sh[:, 0] = gltf.accessor(textured["sh0"])
    count = len(sh)
    no_maps = np.zeros((count, 4), np.int64)

    def own(name, empty):
        return gltf.accessor(textured[name]) if name in textured else empty

    highest = np.full((count, 1), math.isqrt(sh.shape[1]) - 1)
    return Scene(
        positions=gltf.accessor(attributes["POSITION"]),
        rotations=attribute("ROTATION"),
        sigmas=attribute("SCALE")[:, :2],
        opacities=attribute("OPACITY")[:, 0],
        sh=sh,
        degrees=own("shDegree", highest)[:, 0],
        rects=own("rects", no_maps),
        page_of=own("pages", no_maps)[:, 0],
        texel_sizes=own("texelSize", np.zeros((count, 2))),
        shifts=own("shift", np.zeros((count, 2))),
        pages=[gltf.page(page, textured.get("decode")) for page in textured.get("atlas", [])],
        meta=textured["meta"],
    )


def usd_image(asset):
    """Bytes of an asset that a stage refers to, next to the layer or inside its package."""
    path = asset.resolvedPath or asset.path
    if path.endswith("]"):
        package, inside = path[:-1].split("[", 1)
        with zipfile.ZipFile(package) as entries:
            return entries.read(inside)
    with open(path, "rb") as file:
        return file.read()


def read_usd(path):
    """Reads the scene of a .usda, .usdc or .usdz (usd.md)."""
    from pxr import Usd, UsdShade

    stage = Usd.Stage.Open(path)
    root = stage.GetDefaultPrim()
    root.GetVariantSet("representation").SetVariantSelection("textured")
    splats = stage.GetPrimAtPath(f"{root.GetPath()}/Splats")

    def value(name, empty=None):
        attribute = splats.GetAttribute(name)
        return attribute.Get() if attribute and attribute.HasAuthoredValue() else empty

    def primvar(name, empty=None):
        return value(f"primvars:litetex:{name}", empty)

    assert primvar("version") == 3, "unknown version"
    positions = np.array(value("positions"), np.float64)
    count = len(positions)
    degree = value("radiance:sphericalHarmonicsDegree")
    sh = np.array(value("radiance:sphericalHarmonicsCoefficients"), np.float64).reshape(count, (degree + 1) ** 2, 3)
    if primvar("sh0") is not None:
        sh[:, 0] = np.array(primvar("sh0"), np.float64)
    facts = stage.GetRootLayer().customLayerData["litetex"]
    hashes = json.loads(facts.get("sidecars", "{}"))
    pages = []
    for k, (width, height) in enumerate(value("litetex:pageSizes", [])):
        shader = UsdShade.Shader(stage.GetPrimAtPath(f"{root.GetPath()}/Atlas/Page{k}"))
        asset = shader.GetInput("file").Get()
        data = checked(usd_image(asset), asset.path, hashes)
        if primvar("decodeScale") is None:
            texels = read_exr(data)
        else:
            texels = decoded(read_png(data), primvar("decodeScale"), primvar("decodeBias"))
        assert texels.shape == (height, width, 3), f"page of {texels.shape}, expected {(height, width, 3)}"
        pages.append(texels)
    return Scene(
        positions=positions,
        rotations=np.array([[*q.GetImaginary(), q.GetReal()] for q in value("orientations")], np.float64),
        sigmas=np.array(value("scales"), np.float64)[:, :2],
        opacities=np.array(value("opacities"), np.float64),
        sh=sh,
        degrees=np.array(primvar("shDegree", np.full(count, degree)), np.int64),
        rects=np.array(primvar("rect", np.zeros((count, 4))), np.int64),
        page_of=np.array(primvar("page", np.zeros(count)), np.int64),
        texel_sizes=np.array(primvar("texelSize", np.zeros((count, 2))), np.float64).reshape(count, 2),
        shifts=np.array(primvar("shift", np.zeros((count, 2))), np.float64).reshape(count, 2),
        pages=pages,
        meta=json.loads(facts["meta"]),
    )


def read_stream(data, textured, count):
    """Reads the scene of a stream in glTF (gltf.md, section 3a)."""
    assert textured["stream"]["mimeType"] == "application/vnd.litetex.ltgs", "unknown codec"
    assert textured.keys() <= {"version", "quality", "hash", "sidecars", "stream"}, "properties beside the stream"
    scene = read_ltgs(data, textured["hash"])
    assert len(scene.positions) == count, f"{len(scene.positions)} splats, attributes of {count}"
    return scene


def read_ltgs(data, expected_hash=None):
    """Reads the scene of a .ltgs, turned half around x (ltgs.md, section 5); every map is a page of its own."""
    import second_ltgs

    splats, meta = second_ltgs.decoded(data)
    if expected_hash is not None:
        found = second_ltgs.content_hash(splats, meta)
        assert found == expected_hash, f"hash {found}, expected {expected_hash}"
    w, x, y, z = splats.rotations.astype(np.float64).T
    sh = splats.sh.astype(np.float64)
    negated = [k for k in (1, 2, 4, 7, 9, 11, 12, 14) if k < sh.shape[1]]
    sh[:, negated] = -sh[:, negated]
    sides = splats.sides.astype(np.int64)
    textured = (sides[:, 0] > 0).astype(np.int64)
    ends = np.cumsum(sides.prod(axis=1))[textured > 0]
    maps = np.split(splats.texels.astype(np.float64), ends[:-1]) if len(ends) else []
    return Scene(
        positions=splats.positions.astype(np.float64) * [1, -1, -1],
        rotations=np.stack([w, -z, y, -x], axis=1),
        sigmas=splats.sigmas.astype(np.float64),
        opacities=splats.opacities.astype(np.float64),
        sh=sh,
        degrees=splats.degrees.astype(np.int64),
        rects=np.concatenate([0 * sides, sides[:, ::-1]], axis=1),
        page_of=np.maximum(np.cumsum(textured) - 1, 0),
        texel_sizes=splats.texel_sizes.astype(np.float64),
        shifts=splats.shifts.astype(np.float64),
        pages=[texels.reshape(*own, 3) for texels, own in zip(maps, sides[textured > 0], strict=True)],
        meta=meta,
    )


def read_scene(path):
    """Reads a scene, choosing the format by the file's extension."""
    if path.endswith(".ltgs"):
        with open(path, "rb") as file:
            return read_ltgs(file.read())
    return read_gltf(path) if path.endswith((".glb", ".gltf")) else read_usd(path)


# -------------------------------------------------------------------------------------------------------------- image


@dataclass
class Rules:
    """Rules that negative controls can break; the defaults are the specification."""

    data_to_local: tuple = (1.0, -1.0, -1.0)  # section 4
    map_edge: str = "zero"  # section 6: zero outside the map; "edge" clamps
    footprint_max: float = 8.0  # section 6
    pixel_centre: float = 0.5  # section 4
    cut_sigma: float = np.inf  # section 6: no cut-off other than by alpha
    order: str = "depth"  # section 7; "distance" is the order of ellipsoid viewers
    base_min: float = 0.0  # section 5
    stop_below: float = 0.0001  # section 7
    alpha_max: float = float(np.float32(0.99))  # section 7: as f32, so that two clamped samples finish a pixel


def rotation_matrices(quaternions):
    """(n, 3, 3) from unit quaternions xyzw; the columns are the rotated axes."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def sh_basis(directions, count):
    """(n, count): the basis functions of section 5."""
    x, y, z = directions.T
    basis = [
        np.full_like(x, Y_0),
        -0.4886025119029199 * y,
        0.4886025119029199 * z,
        -0.4886025119029199 * x,
        1.0925484305920792 * x * y,
        -1.0925484305920792 * y * z,
        0.31539156525252005 * (2 * z * z - x * x - y * y),
        -1.0925484305920792 * x * z,
        0.5462742152960396 * (x * x - y * y),
        -0.5900435899266435 * y * (3 * x * x - y * y),
        2.890611442640554 * x * y * z,
        -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
        0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
        1.445305721320277 * z * (x * x - y * y),
        -0.5900435899266435 * x * (x * x - 3 * y * y),
    ]
    return np.stack(basis[:count], axis=1)


@dataclass
class Pinhole:
    """A camera from `meta`, in the frame of the scene's data (section 4)."""

    rotation: np.ndarray  # camera_from_data
    translation: np.ndarray
    focal: tuple
    principal: tuple
    size: tuple  # width, height in pixels

    @classmethod
    def of(cls, camera, data_to_local, size=None):
        """From a camera in `meta`, scaled to an image of `size` (width, height) if given."""
        own = (camera["widthPx"], camera["heightPx"])
        size = size or own
        zoom = (size[0] / own[0], size[1] / own[1])
        return cls(
            rotation=np.array(camera["rotationRows"], np.float64) * np.array(data_to_local),
            translation=np.array(camera["translation"], np.float64),
            focal=tuple(f * z for f, z in zip(camera["focalPx"], zoom)),
            principal=tuple(c * z for c, z in zip(camera["principalPx"], zoom)),
            size=size,
        )


@dataclass
class Splat:
    """A splat to draw, in camera axes."""

    p: np.ndarray
    axes: np.ndarray  # columns e_u, e_v, n
    sigma: np.ndarray
    spread: np.ndarray  # V of section 6
    opacity: float  # o' of section 6
    footprint: np.ndarray  # F_u, F_v of section 6
    base: np.ndarray
    texels: np.ndarray  # None without a map
    texel_sizes: np.ndarray  # k_u, k_v
    shift: np.ndarray  # half texels


def filtered(p, axes, sigma, opacity, texel_sizes, pinhole, scene, rules):
    """V, o' and the footprint (section 6)."""
    if scene.meta["filter"] == "none":
        return np.eye(2), opacity, np.ones(2)
    assert scene.meta["filter"] == "ewa", scene.meta["filter"]
    e_u, e_v, n = axes.T
    w = p @ n / p[2]
    rows = [np.cross(e_v, p)[:2] / sigma[0], np.cross(p, e_u)[:2] / sigma[1]]
    m = np.array(rows) / np.array(pinhole.focal) / w
    spread = np.eye(2) + 0.1 * m @ m.T
    texels_per_px = np.linalg.norm(m, axis=1) * sigma / texel_sizes
    footprint = np.sqrt(np.maximum(1, 2 * texels_per_px**2 - 1)).clip(1, rules.footprint_max)
    return spread, opacity / np.sqrt(np.linalg.det(spread)), footprint


def pixel_box(splat, pinhole, near):
    """Pixel bounds (x0, x1, y0, y1) outside which o' G < 1/255: the projected bounding rectangle of the support."""
    width, height = pinhole.size
    reach = np.sqrt(2 * np.log(max(255 * splat.opacity, 1.0))) * 1.001
    reach = reach * np.sqrt(np.diag(splat.spread))
    u, v = splat.axes[:, 0] * splat.sigma[0] * reach[0], splat.axes[:, 1] * splat.sigma[1] * reach[1]
    corners = np.array([splat.p + u + v, splat.p + u - v, splat.p - u + v, splat.p - u - v])
    if corners[:, 2].min() < 0.5 * near or corners[:, 2].min() <= 0:
        return 0, width, 0, height
    x = corners[:, 0] / corners[:, 2] * pinhole.focal[0] + pinhole.principal[0]
    y = corners[:, 1] / corners[:, 2] * pinhole.focal[1] + pinhole.principal[1]
    x0, x1 = np.clip([np.floor(x.min()) - 1, np.ceil(x.max()) + 1], 0, width).astype(int)
    y0, y1 = np.clip([np.floor(y.min()) - 1, np.ceil(y.max()) + 1], 0, height).astype(int)
    return x0, x1, y0, y1


def residuals(splat, a, b, rules):
    """(m, 3): residuals at positions (a, b) on the splat (section 6, steps 5 and 6)."""
    out = np.zeros((len(a), 3))
    if splat.texels is None:
        return out
    rows, cols = splat.texels.shape[:2]
    u = a / splat.texel_sizes[0] + (rows - 1) / 2 - splat.shift[0] / 2
    v = b / splat.texel_sizes[1] + (cols - 1) / 2 - splat.shift[1] / 2
    along_u, along_v = shares(u, rows, splat.footprint[0], rules), shares(v, cols, splat.footprint[1], rules)
    return np.einsum("mi,mj,ijc->mc", along_u, along_v, splat.texels)


def shares(coordinate, size, footprint, rules):
    """(m, size): share of the footprint around each coordinate that lies on each row or column of the map."""
    if rules.map_edge == "edge":
        coordinate = np.clip(coordinate, 0, size - 1)
    distance = np.abs(coordinate[:, None] - np.arange(size)[None, :])
    return np.clip((footprint + 1) / 2 - distance, 0, 1) / footprint


def draw(splat, pinhole, near, rules, light, clear, live):
    """Blends one splat into the image (sections 6 and 7)."""
    x0, x1, y0, y1 = pixel_box(splat, pinhole, near)
    if x0 >= x1 or y0 >= y1:
        return
    (e_u, e_v, n), p = splat.axes.T, splat.p
    rx = ((np.arange(x0, x1) + rules.pixel_centre - pinhole.principal[0]) / pinhole.focal[0])[None, :]
    ry = ((np.arange(y0, y1) + rules.pixel_centre - pinhole.principal[1]) / pinhole.focal[1])[:, None]
    r_n = rx * n[0] + ry * n[1] + n[2]
    depth_ratio = p[2] * r_n / (p @ n)
    hit = live[y0:y1, x0:x1] & (depth_ratio >= 0.0001) & (p[2] >= near * depth_ratio)
    if not hit.any():
        return
    row, col = np.nonzero(hit)
    t = (p @ n) / r_n[row, col]
    offset = t[:, None] * np.stack([rx[0, col], ry[row, 0], np.ones(len(t))], axis=1) - p
    a, b = offset @ e_u, offset @ e_v
    s = np.stack([a / splat.sigma[0], b / splat.sigma[1]])
    square = (s * np.linalg.solve(splat.spread, s)).sum(axis=0)
    o_g = splat.opacity * np.exp(-square / 2)
    seen = (o_g >= 1 / 255) & (square <= rules.cut_sigma**2)
    row, col, a, b = row[seen] + y0, col[seen] + x0, a[seen], b[seen]
    alpha = np.minimum(rules.alpha_max, o_g[seen])
    colour = np.maximum(0.0, splat.base + residuals(splat, a, b, rules))
    rest = clear[row, col] * (1 - alpha)
    stop = rest < rules.stop_below
    live[row[stop], col[stop]] = False
    go = ~stop
    row, col, alpha = row[go], col[go], alpha[go]
    light[row, col] += (clear[row, col] * alpha)[:, None] * colour[go]
    clear[row, col] = rest[go]


def drawn_splats(scene, pinhole, rules):
    """Yields the splats that step 1 of section 6 does not skip, front to back, with their base colours (section 5)."""
    p = scene.positions @ pinhole.rotation.T + pinhole.translation
    axes = pinhole.rotation @ rotation_matrices(scene.rotations)
    eye = -pinhole.rotation.T @ pinhole.translation
    direction = scene.positions - eye
    length = np.linalg.norm(direction, axis=1)
    basis = sh_basis(direction / length[:, None], scene.sh.shape[1])
    # Degree l has the coefficients from l^2 to (l + 1)^2 - 1.
    counts = np.arange(scene.sh.shape[1]) < (scene.degrees[:, None] + 1) ** 2
    base = np.maximum(rules.base_min, 0.5 + np.einsum("nk,nkc->nc", basis * counts, scene.sh))
    finite = np.isfinite(np.concatenate([p, axes.reshape(-1, 9), scene.sigmas, base], axis=1)).all(axis=1)
    p_n = np.abs(np.einsum("ni,ni->n", p, axes[:, :, 2]))
    edge_on = p_n < 0.001 * np.linalg.norm(p, axis=1)
    skip = ~finite | (p[:, 2] < scene.meta["near"]) | ~(scene.opacities >= 1 / 255) | edge_on
    depth = p[:, 2] if rules.order == "depth" else length
    for k in np.argsort(depth.astype(np.float32), kind="stable"):
        if skip[k]:
            continue
        texels = None
        x, y, cols, rows = scene.rects[k]
        if cols > 0 and rows > 0:
            texels = scene.pages[scene.page_of[k]][y : y + rows, x : x + cols]
            assert texels.shape == (rows, cols, 3), f"splat {k}: the rectangle leaves its page"
        sigma, sizes = scene.sigmas[k], scene.texel_sizes[k]
        spread, opacity, footprint = filtered(
            p[k], axes[k], sigma, scene.opacities[k], sizes, pinhole, scene, rules
        )
        if opacity >= 1 / 255:
            yield Splat(p[k], axes[k], sigma, spread, opacity, footprint, base[k], texels, sizes, scene.shifts[k])


def render(scene, camera, rules=Rules(), size=None):
    """Renders a camera of `meta`: (height, width, 3) in the space of the asset, not clamped."""
    pinhole = Pinhole.of(camera, rules.data_to_local, size)
    width, height = pinhole.size
    light, clear = np.zeros((height, width, 3)), np.ones((height, width))
    live = np.ones((height, width), bool)
    with np.errstate(all="ignore"):
        for splat in drawn_splats(scene, pinhole, rules):
            draw(splat, pinhole, scene.meta["near"], rules, light, clear, live)
    return light + clear[:, :, None] * np.array(scene.meta["background"])


# ----------------------------------------------------------------------------------------------------------- comparison


def srgb_from_linear(linear):
    """sRGB code values from linear light, not clamped above."""
    linear = np.maximum(linear, 0.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def linear_from_srgb(code):
    """Linear light from sRGB code values, not clamped above."""
    code = np.maximum(code, 0.0)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)


def read_reference(path, is_linear):
    """Final values of an image written by `litetex render --exr`, converted from its linear light to the colour space of
    the asset."""
    with open(path, "rb") as file:
        light = read_exr(file.read())
    return light if is_linear else srgb_from_linear(light)


def psnr(image, reference):
    """Peak signal-to-noise ratio in dB for a peak of 1, without clamping."""
    assert image.shape == reference.shape, f"{image.shape} against {reference.shape}"
    square = np.mean((image - reference) ** 2)
    return np.inf if square == 0 else -10 * np.log10(square)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file")
    parser.add_argument("--view", required=True, help="name of a camera stored in the file")
    parser.add_argument("-o", "--output", help="write the image to a .npy file (f32)")
    parser.add_argument("--compare", help="print the PSNR against an image written by litetex render --exr")
    arguments = parser.parse_args()
    scene = read_scene(arguments.file)
    image = render(scene, scene.camera(arguments.view))
    if arguments.output:
        np.save(arguments.output, image.astype(np.float32))
    if arguments.compare:
        print(f"{psnr(image, read_reference(arguments.compare, scene.is_linear)):.2f} dB")


if __name__ == "__main__":
    main()
