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
    image = np.zeros((camera.height, camera.width, 4), np.uint8)

    def strips(first: int, end: int) -> None:
        _draw_strips(coverage, surface, painted.pyramids, factor, first, end, image)

    for_row_bands(strips, len(coverage.starts) // 2, work=large.width * large.height)
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


class Fragments(NamedTuple):
    """What the triangles show of a row of pixels: each triangle in each pixel once.

    Attributes:
        triangles, columns: the first is coverage.left's.
        x, y: the middle of the samples that show the triangle.
        shares: how many those are, of all in the pixel.
    """

    triangles: Int[Array, " n"]
    columns: Int[Array, " n"]
    x: Float[Array, " n"]
    y: Float[Array, " n"]
    shares: Float[Array, " n"]


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
    ids = np.empty((STRIP, coverage.width), np.int32)
    nearest = np.empty((STRIP, coverage.width), np.float32)
    most, width = coverage.width * factor, coverage.width // factor
    fragments = Fragments(
        np.empty(most, np.int32),
        np.empty(most, np.int32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
    )
    colours = np.empty((width, 4), np.float32)
    places = np.empty((most, 7))
    rows = STRIP // factor
    for strip in range(first, end):
        cover_strip(coverage, strip, ids, nearest)
        for row in range(strip * rows, min((strip + 1) * rows, len(image))):
            count = _list_fragments(ids, row, coverage.left, factor, fragments)
            colours[:] = 0.0
            _find_places(coverage, surface, fragments, count, places)
            _add_colours(coverage.triangles, surface, pyramids, fragments, count, places, colours)
            _write_row(colours, image, row, coverage.left // factor)


@njit(cache=True, nogil=True, error_model="numpy")
def _list_fragments(ids: Array, row: int, origin: int, factor: int, fragments: Fragments) -> int:
    line, top, all_samples, found = row * factor % STRIP, row * factor + 0.5, factor * factor, 0
    for col in range(ids.shape[1] // factor):
        left = col * factor
        seen = 0
        for a in range(all_samples):
            t = ids[line + a // factor, left + a % factor]
            if t < 0:
                continue
            x, y, count, known = 0, 0, 0, False
            for b in range(all_samples):
                if ids[line + b // factor, left + b % factor] == t:
                    known = known or b < a
                    x, y, count = x + b % factor, y + b // factor, count + 1
            if known:
                continue
            fragments.triangles[found], fragments.columns[found] = t, col
            fragments.x[found] = origin + left + 0.5 + x / count
            fragments.y[found] = top + y / count
            fragments.shares[found] = count / all_samples
            found, seen = found + 1, seen + count
            if seen == all_samples:
                break
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _find_places(
    coverage: Coverage, surface: Surface, fragments: Fragments, count: int, places: Array
) -> None:
    """Barycentrics, texture coordinates, level of detail and brightness of every fragment."""
    triangles, uvs, shades = coverage.triangles, surface.uvs, surface.shades
    for f in range(count):
        t = fragments.triangles[f]
        b0, b1, b2 = barycentrics_at(coverage.planes, t, fragments.x[f], fragments.y[f])
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        places[f, 0], places[f, 1], places[f, 2] = b0, b1, b2
        for c in range(2):
            places[f, 3 + c] = b0 * uvs[t, 0, c] + b1 * uvs[t, 1, c] + b2 * uvs[t, 2, c]
            places[f, 5 + c] = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _add_colours(
    triangles: Array,
    surface: Surface,
    pyramids: Pyramids,
    fragments: Fragments,
    count: int,
    places: Array,
    colours: Array,
) -> None:
    """P02 eq. (5): to every pixel its fragments' weighted sums of the textures."""
    for f in range(count):
        t = fragments.triangles[f]
        b0, b1, b2 = places[f, 0], places[f, 1], places[f, 2]
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        fine, coarse = place_lookup(pyramids, places[f, 3], places[f, 4], places[f, 5])
        red, green, blue = 0.0, 0.0, 0.0
        for n in range(surface.mixes[t]):
            texture = surface.mixed[t, n]
            c = 2 + texture
            shades = surface.shades
            share = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
            r, g, b = weighted_texels(pyramids.texels, texture, fine, coarse)
            red, green, blue = red + share * r, green + share * g, blue + share * b
        col, share = fragments.columns[f], fragments.shares[f]
        lit = share * places[f, 6]
        colours[col, 0] += lit * red
        colours[col, 1] += lit * green
        colours[col, 2] += lit * blue
        colours[col, 3] += share


@njit(cache=True, nogil=True, error_model="numpy")
def _write_row(colours: Array, image: Array, row: int, left: int) -> None:
    for col in range(len(colours)):
        alpha = colours[col, 3]
        whole = 1.0 / max(alpha, np.float32(1e-3))
        for c in range(3):
            image[row, left + col, c] = min(max(np.rint(colours[col, c] * whole), 0.0), 255.0)
        image[row, left + col, 3] = np.rint(alpha * 255.0)
