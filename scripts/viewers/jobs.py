"""What to show in which program: jobs.py FILES CAPTURE BINARY OUT

FILES holds the exports that scripts/viewers.sh makes. Writes OUT/jobs.json for render.mjs, with the home view of the .glb as the
camera, and renders the same view of each file with BINARY into OUT/ours/.
"""

import json
import struct
import subprocess
import sys
from pathlib import Path

KHR = "KHR_gaussian_splatting"
OURS = "LITETEX_gaussian_splatting_texture"
# Program, what it is called, options, and the file of each row. The first row of a program and file is how one would use it.
ROWS = [
    ("three", "three.js r187, add-on", "balanced.glb", {"loader": "gltf", "output": "default"}, "default output"),
    ("three", "three.js r187, add-on", "balanced.glb", {"loader": "gltf", "output": "linear"}, "linear output"),
    ("three", "three.js r187, add-on", "tiny.glb", {"loader": "gltf", "output": "linear"}, "linear output"),
    ("three", "three.js r187, add-on", "y.ply", {"loader": "ply", "output": "linear"}, "`--up three`, linear output"),
    ("three", "three.js r187, add-on", "scene.spz", {"loader": "spz", "output": "linear"}, "linear output"),
    ("three_core", "three.js r187", "balanced.glb", {"loader": "gltf"}, "as points"),
    ("three_core", "three.js r187", "balanced.mesh.glb", {"loader": "gltf"}, ""),
    ("three_core", "three.js r187", "unsorted.mesh.glb", {"loader": "gltf"}, "quads in the order of their splats"),
    ("three_core", "three.js r187", "scene.usdz", {"loader": "usd"}, ""),
    ("three_core", "three.js r187", "mesh.usdz", {"loader": "usd"}, "`--mesh`"),
    ("three_core", "three.js r187", "mesh.usdz", {"loader": "usd", "material": {"depthWrite": False}}, "`--mesh`, `depthWrite = false`"),
    ("spark", "Spark 2.2.0", "y.ply", {}, "`--up spark`"),
    ("spark", "Spark 2.2.0", "scene.spz", {}, ""),
    ("babylon", "Babylon.js 9.35", "balanced.glb", {"rightHanded": True}, ""),
    ("babylon", "Babylon.js 9.35", "tiny.glb", {"rightHanded": True}, ""),
    ("babylon", "Babylon.js 9.35", "balanced.mesh.glb", {"rightHanded": True}, ""),
    ("babylon", "Babylon.js 9.35", "scene.ply", {}, ""),
    ("babylon", "Babylon.js 9.35", "scene.spz", {"turn": True}, "turned by 180° about x"),
    ("babylon", "Babylon.js 9.35", "scene.spz", {"flipY": True, "rightHanded": True}, "`flipY`, right-handed scene"),
    ("playcanvas", "PlayCanvas 2.23", "balanced.glb", {"loader": "gltf"}, ""),
    ("playcanvas", "PlayCanvas 2.23", "tiny.glb", {"loader": "gltf"}, ""),
    ("playcanvas", "PlayCanvas 2.23", "balanced.mesh.glb", {"loader": "gltf"}, ""),
    ("playcanvas", "PlayCanvas 2.23", "y.ply", {"loader": "ply"}, "`--up playcanvas`"),
    ("playcanvas", "PlayCanvas 2.23", "scene.ply", {"loader": "ply", "turn": True}, "turned by 180° about x"),
    ("playcanvas", "PlayCanvas 2.23", "balanced.glb", {"loader": "litetex"}, "with `litetex/playcanvas`"),
    ("playcanvas", "PlayCanvas 2.23", "tiny.glb", {"loader": "litetex"}, "with `litetex/playcanvas`"),
]
# The file whose images are ours, where a row's own cannot be rendered or shows less.
SAME_SCENE = {"y.ply": "scene.ply", "balanced.mesh.glb": "balanced.glb", "unsorted.mesh.glb": "balanced.glb", "mesh.usdz": "scene.usdz"}


def document(path):
    """The JSON of a .glb."""
    data = path.read_bytes()
    (length,) = struct.unpack("<I", data[12:16])
    return json.loads(data[20 : 20 + length])


def home_view(path):
    """Name of the home view's photo and the camera for render.mjs."""
    json_ = document(path)
    node = next(n for n in json_["nodes"] if "camera" in n)
    lens = json_["cameras"][node["camera"]]["perspective"]
    meta = json_["meshes"][0]["primitives"][0]["extensions"][KHR]["extensions"][OURS]["meta"]
    photo = meta["cameras"][meta["home"]]
    assert photo["name"] == node["name"], "the first camera is the home view"
    x, y, z, w = node["rotation"]
    columns = [
        [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w), 0],
        [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w), 0],
        [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y), 0],
        [*node["translation"], 1],
    ]
    (fx, fy), (cx, cy) = photo["focalPx"], photo["principalPx"]
    width, height = photo["widthPx"], photo["heightPx"]
    window = {"left": -cx / fx, "right": (width - cx) / fx, "bottom": (cy - height) / fy, "top": cy / fy}
    matrix = [v for column in columns for v in column]
    return photo["name"], {"width": width, "height": height, "worldFromCamera": matrix, "window": window, "near": lens["znear"]}


def unsort(path, out):
    """Writes a mesh of quads with its indices in the order of the vertices: what sorting them from far to near is worth."""
    data = bytearray(path.read_bytes())
    json_ = document(path)
    (length,) = struct.unpack("<I", data[12:16])
    start = 20 + length + 8
    for primitive in json_["meshes"][0]["primitives"]:
        accessor = json_["accessors"][primitive["indices"]]
        view = json_["bufferViews"][accessor["bufferView"]]
        at = start + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        kind = {5123: "H", 5125: "I"}[accessor["componentType"]]
        quads = accessor["count"] // 6
        indices = [4 * quad + corner for quad in range(quads) for corner in (0, 1, 2, 0, 2, 3)]
        struct.pack_into(f"<{6 * quads}{kind}", data, at, *indices)
    out.write_bytes(data)


def main(files, capture, binary, out):
    unsort(files / "balanced.mesh.glb", files / "unsorted.mesh.glb")
    name, camera = home_view(files / "balanced.glb")
    jobs = []
    for program, title, file, options, note in ROWS:
        number = sum(job["program"] == program and job["row"]["file"] == file for job in jobs)
        job = f"{program}-{file}" + (f"-{number + 1}" if number else "")
        row = {"program": title, "file": file, "note": note, "ours": SAME_SCENE.get(file, file)}
        jobs.append({"name": job, "program": program, "file": str(files / file), "options": options, "camera": camera, "row": row})
    out.mkdir(parents=True, exist_ok=True)
    (out / "jobs.json").write_text(json.dumps(jobs, indent=1))
    for file in sorted({job["row"]["ours"] for job in jobs}):
        # Formats without cameras borrow those of the run.
        borrowed = ["--capture", str(capture)] if file.endswith((".ply", ".spz")) else []
        size = ["--size", f"{camera['width']}x{camera['height']}"]
        command = [binary, "-q", "render", str(files / file), "--view", name, "--device", "cpu", "--force", *borrowed, *size]
        subprocess.run([*command, "-o", str(out / "ours" / file)], check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3], Path(sys.argv[4]))
