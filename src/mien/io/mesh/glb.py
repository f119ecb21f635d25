"""The container of binary glTF 2.0: accessors over one buffer, JSON and buffer in one file."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from mien.arrays import Array, Float, Int

Json = dict[str, Any]

_COMPONENT = {"uint8": 5121, "uint16": 5123, "uint32": 5125, "float32": 5126}
_ARRAY_BUFFER, _ELEMENT_BUFFER = 34962, 34963
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942


class GlbBuffer:
    """The binary part of a .glb under construction; each method returns the index to refer to."""

    def __init__(self) -> None:
        self.accessors: list[Json] = []
        self.views: list[Json] = []
        self._data = bytearray()

    def add_bytes(self, data: bytes, **fields: int) -> int:
        """A buffer view of its own, four-byte aligned, which suits every component type."""
        self._data.extend(bytes(-len(self._data) % 4))
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(data)}
        self._data.extend(data)
        self.views.append(view | fields)
        return len(self.views) - 1

    def add_vectors(self, vectors: Float[Array, "n d"], *, bounds: bool = False) -> int:
        """A vertex attribute; positions need bounds."""
        single = np.ascontiguousarray(vectors, dtype="<f4")
        accessor = {
            "bufferView": self.add_bytes(single.tobytes(), target=_ARRAY_BUFFER),
            "componentType": _COMPONENT["float32"],
            "count": len(single),
            "type": f"VEC{single.shape[1]}",
        }
        return self._add(accessor | (_bounds(single) if bounds else {}))

    def add_samples(self, samples: Float[Array, "*n_d"], *, bounds: bool = False) -> int:
        """What an animation reads: numbers, vectors or quaternions; times need bounds."""
        single = np.ascontiguousarray(samples, dtype="<f4")
        accessor = {
            "bufferView": self.add_bytes(single.tobytes()),
            "componentType": _COMPONENT["float32"],
            "count": len(single),
            "type": f"VEC{single.shape[1]}" if single.ndim == 2 else "SCALAR",
        }
        return self._add(accessor | (_bounds(single.reshape(len(single), -1)) if bounds else {}))

    def add_triangles(self, triangles: Int[Array, "f 3"]) -> int:
        """Vertex indices, as short as they can be."""
        indices = _compact(triangles.ravel(), smallest="uint16")
        return self._add(
            {
                "bufferView": self.add_bytes(indices.tobytes(), target=_ELEMENT_BUFFER),
                "componentType": _COMPONENT[indices.dtype.name],
                "count": indices.size,
                "type": "SCALAR",
            }
        )

    def add_offsets(self, count: int, rows: Int[Array, " n"], offsets: Float[Array, "n 3"]) -> int:
        """(count, 3) morph offsets that are zero but in the given rows, stored sparse if shorter.

        An accessor without data is all zeros (glTF 2.0, 3.6.2.3), and sparse values lie over it.
        """
        accessor: Json = {"componentType": _COMPONENT["float32"], "count": count, "type": "VEC3"}
        dense = np.zeros((count, 3), dtype="<f4")
        dense[rows] = offsets
        indices = _compact(rows, smallest="uint8")
        if indices.nbytes + 12 * len(rows) >= dense.nbytes:
            return self.add_vectors(dense, bounds=True)
        if len(rows):
            accessor["sparse"] = {
                "count": len(rows),
                "indices": {
                    "bufferView": self.add_bytes(indices.tobytes()),
                    "componentType": _COMPONENT[indices.dtype.name],
                },
                "values": {"bufferView": self.add_bytes(dense[rows].tobytes())},
            }
        return self._add(accessor | _bounds(dense))

    def to_glb(self, document: Json) -> bytes:
        """The whole file: the document with this buffer's views and accessors, and the buffer."""
        binary = bytes(self._data) + bytes(-len(self._data) % 4)
        whole = document | {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(binary)}],
        }
        text = json.dumps(whole, ensure_ascii=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = b"".join(
            struct.pack("<II", len(data), kind) + data
            for data, kind in ((text, _JSON_CHUNK), (binary, _BINARY_CHUNK))
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _add(self, accessor: Json) -> int:
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def _bounds(vectors: Float[Array, "n d"]) -> Json:
    return {"min": vectors.min(axis=0).tolist(), "max": vectors.max(axis=0).tolist()}


def _compact(indices: Int[Array, " n"], *, smallest: str) -> Array:
    """The indices in the smallest unsigned type whose largest value (a reserved one) stays free."""
    largest = int(indices.max(initial=0))
    kinds = ("uint8", "uint16", "uint32")
    for kind in kinds[kinds.index(smallest) :]:
        if largest < np.iinfo(kind).max:
            break
    return indices.astype(np.dtype(kind).newbyteorder("<"))
