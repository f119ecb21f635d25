"""One pass over the samples that mixes textures by weights at the vertices (P02 eq. 5)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mien.arrays import Array, Float, Int, UInt8, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.coverage import STRIP, Coverage, barycentrics_at, cover_strip, prepare_coverage
from mien.numeric.threads import for_row_bands
from mien.render.mipmap import (
    Pyramids,
    level_of_detail,
    place_lookup,
    texel_areas,
    weighted_texels,
)
from mien.render.projection import enlarged, project_safely


class Painted(NamedTuple):
    """Triangles and their textures: what does not change with the face.

    Attributes:
        triangles: (F, 3) vertex indices. uvs: (F, 3, 2) of every triangle's corners.
        texels: (F,) how many each triangle covers.
    """

    triangles: Int[Array, "f 3"]
    uvs: Float[Array, "f 3 2"]
    texels: Float[Array, " f"]
    pyramids: Pyramids


class Surface(NamedTuple):
    """What the shown triangles look like.

    Attributes:
        uvs: (F, 3, 2) of every triangle's corners.
        shades: (V, 2 + K) level of detail, brightness, weight of every texture.
        mixed: (F, K) the textures that a triangle shows, in its first `mixes` columns.
        mixes: (F,).
    """

    uvs: Float[Array, "f 3 2"]
    shades: Float[Array, "v s"]
    mixed: Int[Array, "f k"]
    mixes: Int[Array, " f"]


def painted(mesh: Mesh, pyramids: Pyramids) -> Painted:
    """The mesh's triangles. Raises: InputError: a mesh without texture coordinates."""
    if len(mesh.uv_triangles) == 0:
        raise InputError("mesh", "one with texture coordinates", "one without")
    corners = mesh.uvs[mesh.uv_triangles]
    texels = texel_areas(corners, pyramids)
    arrays = (mesh.triangles, corners.astype(np.float32), texels)
    triangles, uvs, texels = (frozen(np.ascontiguousarray(array)) for array in arrays)
    return Painted(triangles, uvs, texels, pyramids)


def draw_mix(
    painted: Painted,
    vertices: Float[Array, "v 3"],
    weights: Float[Array, "v k"],
    brightness: Float[Array, " v"],
    camera: Camera,
    factor: int,
) -> UInt8[Array, "h w 4"]:
    """(H, W, 4) sRGB, straight alpha: textures mixed by weights, times brightness.

    Edges get factor x factor samples a pixel; a triangle is looked up once in each pixel.
    """
    large = enlarged(camera, factor)
    points, depth = project_safely(vertices, large), large.to_camera(vertices)[:, 2]
    coverage = prepare_coverage(points, depth, painted.triangles, large.width, large.height)
    surface = _surface(painted, points, weights, brightness, factor)
    image = np.empty((camera.height, camera.width, 4), np.uint8)

    def strips(first: int, end: int) -> None:
        _draw_strips(coverage, surface, painted.pyramids, factor, first, end, image)

    for_row_bands(strips, len(coverage.starts) - 1, work=large.width * large.height)
    return image


def _surface(
    painted: Painted, points: Array, weights: Array, brightness: Array, factor: int
) -> Surface:
    detail = level_of_detail(painted.texels, points, painted.triangles)
    # One lookup a pixel, with a filter as wide as that of a lookup at every sample.
    detail += np.log2(factor) + 0.5 * np.log2((1 + 2 / factor**2) / 3)
    shades = np.column_stack([detail, brightness, weights]).astype(np.float32)
    faces, textures = len(painted.triangles), weights.shape[1]
    mixed, mixes = np.empty((faces, textures), np.int32), np.zeros(faces, np.int32)
    _list_textures(painted.triangles, shades, mixed, mixes)
    return Surface(painted.uvs, shades, mixed, mixes)


@njit(cache=True, nogil=True)
def _list_textures(triangles: Array, shades: Array, mixed: Array, mixes: Array) -> None:
    for t in range(len(triangles)):
        for texture in range(mixed.shape[1]):
            c = 2 + texture
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            if shades[i, c] != 0.0 or shades[j, c] != 0.0 or shades[k, c] != 0.0:
                mixed[t, mixes[t]] = texture
                mixes[t] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_strips(
    coverage: Coverage,
    surface: Surface,
    pyramids: Pyramids,
    factor: int,
    first: int,
    end: int,
    image: Array,
) -> None:
    width = image.shape[1]
    ids = np.empty((STRIP, width * factor), np.int32)
    nearest = np.empty((STRIP, width * factor), np.float32)
    places, weights = np.empty(8, np.int64), np.empty(8, np.uint64)
    rows = STRIP // factor
    for strip in range(first, end):
        cover_strip(coverage, strip, ids, nearest)
        for row in range(strip * rows, min((strip + 1) * rows, image.shape[0])):
            for col in range(width):
                _resolve(coverage, surface, pyramids, ids, factor, row, col, places, weights, image)


@njit(cache=True, nogil=True, error_model="numpy")
def _resolve(
    coverage: Coverage,
    surface: Surface,
    pyramids: Pyramids,
    ids: Array,
    factor: int,
    row: int,
    col: int,
    places: Array,
    weights: Array,
    image: Array,
) -> None:
    """One pixel: each triangle in it gives its colour once, at the middle of its samples."""
    line, left = (row * factor) % STRIP, col * factor
    red, green, blue, covered = 0.0, 0.0, 0.0, 0
    for a in range(factor * factor):
        t = ids[line + a // factor, left + a % factor]
        if t < 0:
            continue
        x, y, count, known = 0, 0, 0, False
        for b in range(factor * factor):
            if ids[line + b // factor, left + b % factor] == t:
                known = known or b < a
                x, y, count = x + b % factor, y + b // factor, count + 1
        if known:
            continue
        r, g, bl = _colour(
            coverage,
            surface,
            pyramids,
            t,
            left + 0.5 + x / count,
            row * factor + 0.5 + y / count,
            places,
            weights,
        )
        red, green, blue = red + count * r, green + count * g, blue + count * bl
        covered += count
    share = 1.0 / max(covered, 1)
    image[row, col, 0] = _byte(red * share)
    image[row, col, 1] = _byte(green * share)
    image[row, col, 2] = _byte(blue * share)
    image[row, col, 3] = _byte(covered * 255.0 / (factor * factor))


@njit(cache=True, nogil=True, error_model="numpy")
def _colour(
    coverage: Coverage,
    surface: Surface,
    pyramids: Pyramids,
    t: int,
    x: float,
    y: float,
    places: Array,
    weights: Array,
) -> tuple[float, float, float]:
    """P02 eq. (5): the weighted sum of the textures, where triangle t shows the place (x, y)."""
    b0, b1, b2 = barycentrics_at(coverage.planes, t, x, y)
    triangles, uvs, shades = coverage.triangles, surface.uvs, surface.shades
    i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    u = b0 * uvs[t, 0, 0] + b1 * uvs[t, 1, 0] + b2 * uvs[t, 2, 0]
    v = b0 * uvs[t, 0, 1] + b1 * uvs[t, 1, 1] + b2 * uvs[t, 2, 1]
    level = b0 * shades[i, 0] + b1 * shades[j, 0] + b2 * shades[k, 0]
    brightness = b0 * shades[i, 1] + b1 * shades[j, 1] + b2 * shades[k, 1]
    count = place_lookup(pyramids, u, v, level, places, weights)
    red, green, blue = 0.0, 0.0, 0.0
    for n in range(surface.mixes[t]):
        texture = surface.mixed[t, n]
        c = 2 + texture
        share = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
        r, g, b = weighted_texels(pyramids.texels, texture, places, weights, count)
        red, green, blue = red + share * r, green + share * g, blue + share * b
    return red * brightness, green * brightness, blue * brightness


@njit(cache=True, nogil=True)
def _byte(value: float) -> int:
    return int(min(max(np.rint(value), 0.0), 255.0))
