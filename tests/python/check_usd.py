#!/usr/bin/env python3
"""Checks USD files with Pixar's library (pip install usd-core==26.11 numpy; 26.3 opens them too).

    check_usd.py EXPECTED.json FILE...

EXPECTED.json: {"FILE NAME": {"count": N, "arrays": {"VARIANT/PROPERTY": CRC32 of little-endian bytes}}}. Files it does not
list are checked without hashes. To write samples: LITETEX_USD_SAMPLES=DIR cargo test -p litetex-exporters samples_

Checks every variant of `representation`: no validator of UsdValidation reports an error; the rules they do not cover hold
(array lengths, one kernel, finite numbers, extents, schema names); arrays equal the expected ones bit for bit; the stage is
not empty; all asset dependencies resolve. Exits with 1 if any check fails.
"""

import json
import os
import sys
import zlib

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdUtils

FIELDS = ("ParticleField", "ParticleField3DGaussianSplat")
ARRAYS = ("positions", "orientations", "scales", "opacities", "radiance:sphericalHarmonicsCoefficients")


def array(prim, name):
    """Value of an attribute as an array, one row per element; quaternions are xyzw."""
    value = prim.GetAttribute(name).Get()
    return np.zeros((0, 1)) if value is None else np.asarray(value)


def validation_errors(stage):
    """Errors of UsdValidation; none in versions without that module."""
    try:
        from pxr import UsdValidation
    except ImportError:
        return []
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) >= 20, f"only {len(validators)} validators"
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [f"{e.GetName()}: {e.GetMessage()}" for e in errors]


def rotated(quaternions, axis):
    """The given axis, 0 or 1, rotated by each quaternion (xyzw): columns of rotation matrices."""
    x, y, z, w = quaternions.astype(np.float64).T
    if axis == 0:
        return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1)
    return np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], 1)


def check_field(prim):
    """Yields violations of the rules of particle fields that UsdValidation does not check."""
    schemas = prim.GetAppliedSchemas()
    known = Usd.SchemaRegistry()
    # GetAppliedSchemas drops names that are not registered, so check the authored ones.
    for name in prim.GetPrimTypeInfo().GetAppliedAPISchemas():
        if known.FindAppliedAPIPrimDefinition(name.split(":")[0]) is None and ":" not in name:
            yield f"unknown applied schema {name}"
    kernels = [s for s in schemas if "Kernel" in s and "Base" not in s]
    if len(kernels) != 1:
        yield f"kernels {kernels}, expected one"
    values = {name: array(prim, name) for name in ARRAYS}
    count = len(values["positions"])
    degree = prim.GetAttribute("radiance:sphericalHarmonicsDegree").Get()
    for name, value in values.items():
        expected = count * (degree + 1) ** 2 if name.startswith("radiance") else count
        if len(value) != expected:
            yield f"{name}: {len(value)} elements, expected {expected}"
            return
        if not np.isfinite(value).all():
            yield f"{name}: values that are not finite"
    extent = prim.GetAttribute("extent").Get()
    if extent is None or len(extent) != 2:
        yield "no extent"
    elif count:
        q, s = values["orientations"], 3.0 * values["scales"].astype(np.float64)
        half = np.hypot(rotated(q, 0) * s[:, :1], rotated(q, 1) * s[:, 1:2])
        low, high = np.asarray(extent, dtype=np.float64)
        p = values["positions"].astype(np.float64)
        if ((p - half) < low).any() or ((p + half) > high).any():
            yield "the extent does not cover the particles"


def check_arrays(stage, variant, arrays):
    """Yields arrays of the variant whose hash is not the expected one."""
    for key, expected in arrays.items():
        name, attribute = key.split("/")
        if name != variant:
            continue
        value = stage.GetPrimAtPath("/Scene/Splats").GetAttribute(attribute).Get()
        data = b"" if value is None else np.ascontiguousarray(np.asarray(value)).tobytes()
        if zlib.crc32(data) != expected:
            yield f"{attribute}: {len(data)} bytes with a hash other than expected"


def check_camera(stage):
    """Yields differences between the camera of the home view and the metadata."""
    meta = json.loads(stage.GetRootLayer().customLayerData["litetex"]["meta"])
    prim = stage.GetPrimAtPath("/Cameras/main_cam")
    if "home" not in meta:
        if prim:
            yield "a main camera, though the metadata have no home view"
        return
    if not prim or prim.GetTypeName() != "Camera":
        yield "no main camera"
        return
    camera, photo = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode.Default()), meta["cameras"][meta["home"]]
    (fx, fy), (cx, cy) = photo["focalPx"], photo["principalPx"]
    window = [-cx / fx, (cy - photo["heightPx"]) / fy, (photo["widthPx"] - cx) / fx, cy / fy]
    found = [*camera.frustum.window.min, *camera.frustum.window.max]
    if np.abs(np.subtract(found, window)).max() > 1e-5:  # f32: needed 1e-7
        yield f"the main camera sees {found}, expected {window}"
    # Both frames of the file have y up, and a camera looks along -z in USD.
    rows, flip = np.array(photo["rotationRows"]), np.array([1, -1, -1])
    scene = np.array(UsdGeom.Xformable(stage.GetDefaultPrim()).GetLocalTransformation())
    centre = np.append(flip * -(rows.T @ photo["translation"]), 1) @ scene
    ahead = np.append(flip * rows[2], 0) @ scene
    world = np.array(camera.transform)
    unit = np.linalg.norm(ahead)
    # f64: needed 1e-10 units, 140,000 units from the origin.
    if np.abs(world[3] - centre).max() > 1e-6 * unit:
        yield f"the main camera stands at {world[3]}, expected {centre}"
    if np.abs(-world[2] - ahead / unit).max() > 1e-6:
        yield f"the main camera looks along {-world[2]}, expected {ahead / unit}"


def opened(path):
    """The stage with the textured splats shown."""
    stage = Usd.Stage.Open(path)
    stage.SetEditTarget(stage.GetSessionLayer())
    stage.GetDefaultPrim().GetVariantSet("representation").SetVariantSelection("textured")
    return stage


def check_file(path, expected):
    """Yields all problems of a file."""
    stage = Usd.Stage.Open(path)
    scene = stage.GetDefaultPrim()
    if not scene:
        yield "empty stage"
        return
    _, _, unresolved = UsdUtils.ComputeAllDependencies(path)
    if unresolved:
        yield f"unresolved {unresolved}"
    yield from check_camera(stage)
    representation = scene.GetVariantSet("representation")
    expected_variant = "mesh" if "mesh" in representation.GetVariantNames() else "textured"
    if representation.GetVariantSelection() != expected_variant:
        yield f"the default variant is not {expected_variant}"
    for variant in representation.GetVariantNames():
        representation.SetVariantSelection(variant)
        prims = list(stage.Traverse())
        has_content = expected.get("count") == 0 or len(prims) > 1
        if not has_content:
            yield f"{variant}: no prims"
        problems = validation_errors(stage)
        fields = [p for p in prims if p.GetTypeName() in FIELDS]
        if variant != "mesh" and len(fields) != 1:
            problems.append(f"{len(fields)} particle fields")
        for prim in fields:
            problems += check_field(prim)
            if "count" in expected and len(array(prim, "positions")) != expected["count"]:
                problems.append(f"{len(array(prim, 'positions'))} particles, expected {expected['count']}")
        problems += check_arrays(stage, variant, expected.get("arrays", {}))
        yield from (f"{variant}: {p}" for p in problems)


def check_text_equals_binary(paths):
    """Yields pairs of .usda and .usdc whose layers differ in more than the paths of images."""
    for path in paths:
        other = path[:-1] + "c"
        if path.endswith(".usda") and other in paths:
            texts = [Sdf.Layer.FindOrOpen(p).ExportToString().split("\n", 1)[1] for p in (path, other)]
            texts[0] = texts[0].replace("_usda_textures/", "_usdc_textures/")
            if texts[0] != texts[1]:
                yield path, "text and binary differ"


def controls(path):
    """Negative controls: breaks each rule in memory and yields those whose violation goes unnoticed."""
    surflet, ellipsoid = "ParticleFieldKernelGaussianSurfletAPI", "ParticleFieldKernelGaussianEllipsoidAPI"

    def set_nan(prim):
        values = np.array(prim.GetAttribute("opacities").Get())
        values[-1] = np.nan
        prim.GetAttribute("opacities").Set(values)

    def edit_schemas(prim, remove, add):
        schemas = Sdf.TokenListOp()
        kept = [s for s in prim.GetMetadata("apiSchemas").GetAppliedItems() if s != remove]
        schemas.explicitItems = kept + [s for s in [add] if s]
        prim.SetMetadata("apiSchemas", schemas)

    breaches = {
        "short array": lambda p: p.GetAttribute("scales").Set(p.GetAttribute("scales").Get()[:-1]),
        "no kernel": lambda p: edit_schemas(p, surflet, None),
        "two kernels": lambda p: edit_schemas(p, None, ellipsoid),
        "not finite": set_nan,
        "no extent": lambda p: p.GetAttribute("extent").Block(),
        "small extent": lambda p: p.GetAttribute("extent").Set([(0, 0, 0), (0.01, 0.01, 0.01)]),
        "unknown schema": lambda p: edit_schemas(p, None, "ParticleFieldColourAPI"),
    }
    for name, breach in breaches.items():
        stage = opened(path)
        prim = stage.GetPrimAtPath("/Scene/Splats")
        assert not list(check_field(prim)), f"{path} must be valid"
        breach(prim)
        if not list(check_field(stage.GetPrimAtPath("/Scene/Splats"))):
            yield path, f"negative control \"{name}\" was not caught"
        stage.GetSessionLayer().Clear()
    if not list(check_arrays(opened(path), "textured", {"textured/positions": 1})):
        yield path, "negative control \"hash\" was not caught"
    stage = opened(path)
    if stage.GetPrimAtPath("/Cameras/main_cam"):
        stage.GetPrimAtPath("/Cameras/main_cam").GetAttribute("horizontalApertureOffset").Set(9.0)
        if not list(check_camera(stage)):
            yield path, "negative control \"camera\" was not caught"


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        expected = json.load(file)
    paths = sys.argv[2:]
    problems = [(p, problem) for p in paths for problem in check_file(p, expected.get(os.path.basename(p), {}))]
    problems += check_text_equals_binary(paths)
    with_splats = [p for p in paths if expected.get(os.path.basename(p), {}).get("count", 0) > 0]
    problems += [uncaught for p in with_splats[:1] for uncaught in controls(p)]
    for path, problem in problems:
        print(f"{path}: {problem}")
    print(f"usd-core {Usd.GetVersion()}: {len(paths)} files, {len(problems)} problems")
    sys.exit(1 if problems or not paths else 0)


if __name__ == "__main__":
    main()
