"""Reads glTF as JSON and arrays, from the glTF 2.0 specification alone: shares no code with the project."""

import json
import os
import struct
from urllib.parse import unquote

import numpy as np

KHR = "KHR_gaussian_splatting"
OURS = "LITETEX_gaussian_splatting_texture"
DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# Signs of the SH coefficients between y up and y down, degree by degree.
SH_SIGNS = np.array([1, -1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1], dtype=np.float64)


class Gltf:
    """A .glb, or a .gltf with one external buffer."""

    def __init__(self, path):
        with open(path, "rb") as file:
            data = file.read()
        if path.endswith(".glb"):
            length = struct.unpack_from("<I", data, 12)[0]
            self.json, self.bin = json.loads(data[20 : 20 + length]), data[28 + length :]
        else:
            self.json = json.loads(data)
            with open(os.path.join(os.path.dirname(path), unquote(self.json["buffers"][0]["uri"])), "rb") as file:
                self.bin = file.read()
        self.primitive = self.json["meshes"][0]["primitives"][0]
        self.splatting = self.primitive["extensions"][KHR]
        self.textures = self.splatting["extensions"][OURS]

    def accessor(self, index):
        """Values of an accessor, [count, width]."""
        entry = self.json["accessors"][index]
        view = self.json["bufferViews"][entry["bufferView"]]
        dtype, width = np.dtype(DTYPES[entry["componentType"]]), WIDTHS[entry["type"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        stride = view.get("byteStride", width * dtype.itemsize)
        return np.ndarray((entry["count"], width), dtype, self.bin, start, (stride, dtype.itemsize)).copy()

    def attribute(self, name):
        """Values of an attribute of core glTF or of KHR_gaussian_splatting."""
        attributes = self.primitive["attributes"]
        return self.accessor(attributes[name if name in attributes else f"{KHR}:{name}"])

    def sh(self):
        """SH coefficients [count, coefficients, 3], y up, as read by viewers without texture support."""
        names = [f"SH_DEGREE_{l}_COEF_{n}" for l in range(4) for n in range(2 * l + 1)]
        known = [name for name in names if f"{KHR}:{name}" in self.primitive["attributes"]]
        return np.stack([self.attribute(name) for name in known], 1)
