"""The virtual cylinder around the head: rays towards its axis, and texture coordinates on it.

The axis is upright (head space y) through the middle of the head. Looking at the face, u runs from
the subject's right (-x) over the middle of the face (u = 0.5) to the left; the seam is at the back.
v runs upwards from the lowest to the highest point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float, frozen
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.texture.surface import SurfaceMap, surface_from

WIDTH, HEIGHT = 2048, 1024


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder.

    Attributes:
        axis_x: mm, of its axis.
        axis_z: mm, of its axis.
        bottom: mm, the height where v is 0.
        top: mm, the height where v is 1.
    """

    axis_x: float
    axis_z: float
    bottom: float
    top: float

    def uvs(self, points: Float[Array, "*n 3"]) -> Float[Array, "*n 2"]:
        """(..., 2) texture coordinates of points in head space (mm); u from 0 to 1."""
        angle = np.arctan2(points[..., 0] - self.axis_x, points[..., 2] - self.axis_z)
        height = (points[..., 1] - self.bottom) / (self.top - self.bottom)
        return np.stack([angle / (2 * np.pi) + 0.5, height], axis=-1)


def fit_cylinder(mesh: Mesh, *parts: str) -> Cylinder:
    """The cylinder around the named parts (default: the skin, else everything).

    The axis goes through the middle of the box around their upper half, which the neck and
    shoulders leave alone.

    Raises:
        InputError: no triangles.
    """
    names = parts or (("skin",) if "skin" in mesh.part_names else mesh.part_names)
    used = mesh.vertices_of(*names)
    if not len(used):
        raise InputError("mesh", "triangles to put a cylinder around", "none")
    points = mesh.vertices[used]
    low, high = points.min(axis=0), points.max(axis=0)
    upper = points[points[:, 1] >= (low[1] + high[1]) / 2]
    middle = (upper.min(axis=0) + upper.max(axis=0)) / 2
    return Cylinder(float(middle[0]), float(middle[2]), float(low[1]), float(high[1]))


def cylinder_surface(
    mesh: Mesh,
    cylinder: Cylinder,
    *,
    width: int = WIDTH,
    height: int = HEIGHT,
    parts: tuple[str, ...] | None = None,
) -> SurfaceMap:
    """The first surface that rays from the cylinder towards its axis meet.

    Args:
        mesh: of the head.
        cylinder: around it.
        width: texels.
        height: texels.
        parts: names of the parts that can be met; all by default.

    Source:
        [Pighin 2002] sec. 5.2.2, step 2. The intersection of ray and triangle is exact; only
        triangles whose range of angle and height holds the ray are tried.
    """
    chosen = np.arange(len(mesh.triangles)) if parts is None else mesh.triangles_of(*parts)
    points = mesh.vertices - [cylinder.axis_x, 0, cylinder.axis_z]
    angles = 2 * np.pi * (np.arange(width) + 0.5) / width - np.pi
    fraction = (np.arange(height) + 0.5) / height
    heights = cylinder.top + fraction * (cylinder.bottom - cylinder.top)
    ids = np.full((height, width), -1, np.int32)
    barycentrics = np.zeros((height, width, 3), np.float32)
    radius = np.full((height, width), -1, np.float32)
    arrays = (points, mesh.triangles[chosen], np.sin(angles), np.cos(angles), heights)
    inputs = [frozen(np.ascontiguousarray(array)) for array in arrays]

    def rows(first: int, end: int) -> None:
        _cast_rows(*inputs, first, end, ids, barycentrics, radius)

    for_row_bands(rows, height, work=width * height)
    ids = np.append(chosen, -1).astype(np.int32)[ids]
    return surface_from(mesh, ids, barycentrics, wrap=True)


@njit(cache=True, nogil=True)
def _columns(a: Array, b: Array, c: Array, width: int) -> tuple[int, int]:
    """First and last column (perhaps beyond the ends) whose rays can meet the triangle."""
    # Signs of the axis as seen from the edges, from above: all alike when it runs through.
    s0 = a[2] * b[0] - a[0] * b[2]
    s1 = b[2] * c[0] - b[0] * c[2]
    s2 = c[2] * a[0] - c[0] * a[2]
    if (s0 >= 0 and s1 >= 0 and s2 >= 0) or (s0 <= 0 and s1 <= 0 and s2 <= 0):
        return 0, width - 1
    middle = np.arctan2(a[0], a[2])
    low = high = middle
    for p in (b, c):
        # Relative to the first corner: a triangle that the axis misses spans less than pi.
        turn = np.arctan2(p[0], p[2]) - middle
        turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
        low, high = min(low, middle + turn), max(high, middle + turn)
    scale = width / (2 * np.pi)
    return int(np.floor((low + np.pi) * scale - 0.5)), int(np.ceil((high + np.pi) * scale - 0.5))


@njit(cache=True, nogil=True)
def _cast_triangle(
    a: Array,
    b: Array,
    c: Array,
    t: int,
    columns: tuple[int, int],
    row: int,
    height: float,
    sines: Array,
    cosines: Array,
    ids: Array,
    barycentrics: Array,
    radius: Array,
) -> None:
    """Write triangle t into one row where it is the outermost so far."""
    width = len(sines)
    ya, yb, yc = a[1] - height, b[1] - height, c[1] - height
    # Triple products of the ray with two corners: coefficients of its sine and cosine. Both
    # triangles at an edge get the same number with opposite signs: no gaps.
    s0, c0 = yb * c[2] - b[2] * yc, b[0] * yc - yb * c[0]
    s1, c1 = yc * a[2] - c[2] * ya, c[0] * ya - yc * a[0]
    s2, c2 = ya * b[2] - a[2] * yb, a[0] * yb - ya * b[0]
    for turn in range(columns[0], columns[1] + 1):
        col = turn % width
        sine, cosine = sines[col], cosines[col]
        e0, e1, e2 = sine * s0 + cosine * c0, sine * s1 + cosine * c1, sine * s2 + cosine * c2
        total = e0 + e1 + e2
        if total == 0.0 or min(e0 * total, e1 * total, e2 * total) < 0.0:
            continue
        x = (e0 * a[0] + e1 * b[0] + e2 * c[0]) / total
        z = (e0 * a[2] + e1 * b[2] + e2 * c[2]) / total
        r = np.float32(x * sine + z * cosine)
        if r > 0 and r > radius[row, col]:
            radius[row, col] = r
            ids[row, col] = t
            barycentrics[row, col, 0] = e0 / total
            barycentrics[row, col, 1] = e1 / total
            barycentrics[row, col, 2] = e2 / total


@njit(cache=True, nogil=True)
def _cast_rows(
    points: Array,
    triangles: Array,
    sines: Array,
    cosines: Array,
    heights: Array,
    first: int,
    end: int,
    ids: Array,
    barycentrics: Array,
    radius: Array,
) -> None:
    count = len(heights)
    step = (heights[0] - heights[count - 1]) / max(count - 1, 1)
    for t in range(triangles.shape[0]):
        a, b, c = points[triangles[t, 0]], points[triangles[t, 1]], points[triangles[t, 2]]
        highest, lowest = max(a[1], b[1], c[1]), min(a[1], b[1], c[1])
        top = max(int(np.floor((heights[0] - highest) / step)), first)
        bottom = min(int(np.ceil((heights[0] - lowest) / step)), end - 1)
        if top > bottom:
            continue
        columns = _columns(a, b, c, len(sines))
        for row in range(top, bottom + 1):
            y = heights[row]
            _cast_triangle(a, b, c, t, columns, row, y, sines, cosines, ids, barycentrics, radius)
