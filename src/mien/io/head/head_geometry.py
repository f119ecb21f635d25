"""`geometry.npz` of a head folder, and checks that its shapes are those of a head."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import load_generic_head
from mien.errors import DocumentError, FileFormatError
from mien.head import NEUTRAL
from mien.limits import MAX_MM
from mien.mesh import Mesh
from mien.reading.npz import ArrayFile

MIN_EXTENT_MM = 0.01
"""Least extent of every part of the mesh in each direction: its smallest singular value."""
_UV_TOLERANCE = 1e-3


@dataclass(frozen=True)
class HeadGeometry:
    """The arrays of a head.

    Attributes:
        mesh: over the neutral shape.
        shapes: (V, 3) mm by expression.
        uncertainty_mm: (V,).
        unit_offsets: (K, V, 3) mm.
    """

    mesh: Mesh
    shapes: Mapping[str, Float[Array, "v 3"]]
    uncertainty_mm: Float[Array, " v"]
    unit_offsets: Float[Array, "k v 3"]


def load_geometry(
    path: Path, expressions: Sequence[str], part_names: tuple[str, ...], units: int
) -> HeadGeometry:
    """The arrays in a file.

    Args:
        path: the file.
        expressions: names, neutral among them.
        part_names: of the mesh, in the order of their indices.
        units: how many face units there are.

    Raises:
        FileFormatError: names the array: missing, of another kind or shape, an index or a number
            out of range, a part without extent.
    """
    with ArrayFile(path) as arrays:
        neutral = arrays.numbers(f"vertices/{NEUTRAL}", (None, 3), most=MAX_MM)
        count = len(neutral)
        shapes = {
            name: arrays.numbers(f"vertices/{name}", (count, 3), most=MAX_MM)
            for name in expressions
            if name != NEUTRAL
        }
        triangles = arrays.whole("triangles", (None, 3), below=count)
        uvs = arrays.numbers("uvs", (None, 2))
        mesh = Mesh(
            vertices=neutral,
            triangles=triangles,
            uvs=uvs,
            uv_triangles=arrays.whole("uv_triangles", (len(triangles), 3), below=len(uvs)),
            part=arrays.whole("part", (len(triangles),), below=len(part_names)),
            part_names=part_names,
        )
        if uvs.size and not (uvs.min() >= -_UV_TOLERANCE and uvs.max() <= 1 + _UV_TOLERANCE):
            found = f"{uvs.min():g} to {uvs.max():g}"
            raise FileFormatError(path, f"expected numbers from 0 to 1, found {found}", "uvs")
        geometry = HeadGeometry(
            mesh=mesh,
            shapes={name: neutral if name == NEUTRAL else shapes[name] for name in expressions},
            uncertainty_mm=arrays.numbers("uncertainty_mm", (count,), most=MAX_MM),
            unit_offsets=arrays.numbers("unit_offsets", (units, count, 3), most=MAX_MM),
        )
    for name, vertices in geometry.shapes.items():
        _check_extent(path, f"vertices/{name}", mesh, vertices)
    return geometry


def _check_extent(path: Path, name: str, mesh: Mesh, vertices: Float[Array, "v 3"]) -> None:
    """Raises: FileFormatError: a part that lies in one point, line or plane."""
    for index, part in enumerate(mesh.part_names):
        corners = np.unique(mesh.triangles[mesh.part == index])
        if len(corners) < 4:
            continue
        points = vertices[corners]
        singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if singular[-1] < MIN_EXTENT_MM:
            problem = (
                f"expected a part with some extent, found {part!r} in one point, line or plane"
            )
            raise FileFormatError(path, problem, name)


def check_names(mesh: Mesh, unit_names: tuple[str, ...]) -> None:
    """Check that a head of the generic topology has the generic names of parts and units.

    Raises:
        DocumentError: other ones, or in another order.
    """
    generic = load_generic_head()
    if mesh.vertices.shape != generic.mesh.vertices.shape:
        return
    for place, found, expected in (
        ("parts", mesh.part_names, generic.mesh.part_names),
        ("face_units", unit_names, generic.unit_names),
    ):
        if found != expected:
            wrong = next((name for name in found if name not in expected), None)
            what = f"{wrong[:60]!r}" if wrong else f"{len(found)} of them, or another order"
            problem = f"expected the generic head's {len(expected)} in their order, found {what}"
            raise DocumentError(place, problem)
