"""A reader of .glb for the tests of its writers."""

from __future__ import annotations

import io
import json
import struct
from typing import Any

import numpy as np
from PIL import Image

KINDS = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


class Glb:
    """A .glb taken apart by the letter of the specification, independently of the writer."""

    def __init__(self, data: bytes) -> None:
        magic, version, length = struct.unpack_from("<4sII", data)
        assert (magic, version, length) == (b"glTF", 2, len(data))
        size, kind = struct.unpack_from("<I4s", data, 12)
        assert kind == b"JSON"
        self.json: dict[str, Any] = json.loads(data[20 : 20 + size])
        self.binary = data[28 + size :]
        assert struct.unpack_from("<I4s", data, 20 + size) == (len(self.binary), b"BIN\0")
        self.primitives = self.json["meshes"][0]["primitives"]
        self.material_names = [item["name"] for item in self.json["materials"]]

    def view(self, index: int) -> bytes:
        view = self.json["bufferViews"][index]
        return self.binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]

    def array(self, index: int) -> np.ndarray:
        accessor = self.json["accessors"][index]
        shape = accessor["count"], WIDTHS[accessor["type"]]
        values = np.zeros(shape, KINDS[accessor["componentType"]])
        if "bufferView" in accessor:
            data = self.view(accessor["bufferView"])
            values = np.frombuffer(data, values.dtype).reshape(shape).copy()
        if "sparse" in accessor:
            rows, new = (accessor["sparse"][key] for key in ("indices", "values"))
            where = np.frombuffer(self.view(rows["bufferView"]), KINDS[rows["componentType"]])
            values[where] = np.frombuffer(self.view(new["bufferView"]), "<f4").reshape(-1, 3)
        return values

    def primitive(self, material: str) -> dict[str, Any]:
        return self.primitives[self.material_names.index(material)]

    def corners(self, primitive: dict[str, Any], attribute: str) -> np.ndarray:
        """(F, 3, ...) what the triangles' corners have."""
        triangles = self.array(primitive["indices"]).reshape(-1, 3)
        return self.array(primitive["attributes"][attribute])[triangles]

    def pixels(self, material: int) -> np.ndarray:
        """The picture that is this material's colour."""
        reflection = self.json["materials"][material]["pbrMetallicRoughness"]
        source = self.json["textures"][reflection["baseColorTexture"]["index"]]["source"]
        data = self.view(self.json["images"][source]["bufferView"])
        return np.asarray(Image.open(io.BytesIO(data)))

    def target(self, primitive: dict[str, Any], name: str) -> np.ndarray:
        names = self.json["meshes"][0]["extras"]["targetNames"]
        triangles = self.array(primitive["indices"]).reshape(-1, 3)
        return self.array(primitive["targets"][names.index(name)]["POSITION"])[triangles]
