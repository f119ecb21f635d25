"""One pass over the samples that mixes textures by weights at the vertices.

Source:
    [Pighin 2002] eq. 5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Float, Int, UInt8, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.numeric.raster.coverage import (
    STRIP,
    Coverage,
    barycentrics_at,
    cover_strip,
    prepare_coverage,
)
from mien.render.mipmap import (
    Pyramids,
    level_of_detail,
    place_lookup,
    texel_areas,
    weighted_texels,
)
from mien.render.projection import project_safely


class Painted(NamedTuple):
    """Triangles and their textures: what does not change with the face.

    Attributes:
        triangles: (F, 3) vertex indices.
        uvs: (F, 3, 2) of every triangle's corners.
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


def prepare_painted(mesh: Mesh, pyramids: Pyramids) -> Painted:
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
    large = camera.resized(factor)
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
    faces, textures = len(painted.triangles), weights.shape[1]
    shades = np.empty((len(points), 2 + textures), np.float32)
    shades[:, 0], shades[:, 1], shades[:, 2:] = detail, brightness, weights
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
        triangles: of the coverage.
        columns: of pixels; the first holds the coverage's first.
        x: in the strip, the middle of the samples that show the triangle.
        y: in the strip, the middle of the samples that show the triangle.
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
    most, left = coverage.width * factor, coverage.left // factor
    fragments = Fragments(
        np.empty(most, np.int32),
        np.empty(most, np.int32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
        np.empty(most, np.float32),
    )
    places = np.empty((most, 7))
    colours = np.empty((coverage.width // factor, 4), np.float32)
    for strip in range(first, end):
        first_sample, end_sample = cover_strip(coverage, strip, ids, nearest)
        columns = range(first_sample // factor, (end_sample + factor - 1) // factor)
        for line in range(0, STRIP, factor):
            row = (strip * STRIP + line) // factor
            if row == len(image):
                break
            count = _list_fragments(ids, line, columns, factor, fragments)
            _find_places(coverage, surface, fragments, strip, count, places)
            colours[:] = 0.0
            _add_colours(coverage.triangles, surface, pyramids, fragments, count, places, colours)
            _write_row(colours, columns, image[row], left)


@njit(cache=True, nogil=True, error_model="numpy")
def _list_fragments(
    ids: Array, line: int, columns: range, factor: int, fragments: Fragments
) -> int:
    """Fill in the fragments of the pixels whose samples begin in this line; return their number."""
    middle, found = 0.5 * factor, 0
    for col in columns:
        t = ids[line, col * factor]
        alike = True
        for a in range(line, line + factor):
            for b in range(col * factor, (col + 1) * factor):
                alike &= ids[a, b] == t
        if not alike:
            found = _list_mixed(ids, line, col, factor, fragments, found)
        elif t >= 0:
            fragments.triangles[found], fragments.columns[found] = t, col
            fragments.x[found], fragments.y[found] = col * factor + middle, line + middle
            fragments.shares[found] = 1.0
            found += 1
    return found


@njit(inline="always")
def _list_mixed(
    ids: Array, line: int, col: int, factor: int, fragments: Fragments, first: int
) -> int:
    """The same for one pixel that shows several triangles, or one in a part of it."""
    triangles, end = fragments.triangles, first
    for a in range(line, line + factor):
        for b in range(col * factor, (col + 1) * factor):
            if ids[a, b] < 0:
                continue
            f = first
            while f < end and triangles[f] != ids[a, b]:
                f += 1
            if f == end:
                triangles[f], fragments.columns[f] = ids[a, b], col
                fragments.x[f], fragments.y[f], fragments.shares[f] = 0.0, 0.0, 0.0
                end += 1
            fragments.x[f] += b + 0.5
            fragments.y[f] += a + 0.5
            fragments.shares[f] += 1.0
    for f in range(first, end):
        fragments.x[f] /= fragments.shares[f]
        fragments.y[f] /= fragments.shares[f]
        fragments.shares[f] /= factor * factor
    return end


# Columns of places.
B0, B1, B2, U, V, LEVEL, BRIGHTNESS = range(7)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _find_places(
    coverage: Coverage,
    surface: Surface,
    fragments: Fragments,
    strip: int,
    count: int,
    places: Array,
) -> None:
    """Fill in where in their triangles, and where in the textures, the fragments are."""
    triangles, uvs, shades = coverage.triangles, surface.uvs, surface.shades
    left, top = coverage.left, strip * STRIP
    for f in range(count):
        t = fragments.triangles[f]
        x, y = left + fragments.x[f], top + fragments.y[f]
        b0, b1, b2 = barycentrics_at(coverage.planes, t, x, y)
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        places[f, B0], places[f, B1], places[f, B2] = b0, b1, b2
        places[f, U] = b0 * uvs[t, 0, 0] + b1 * uvs[t, 1, 0] + b2 * uvs[t, 2, 0]
        places[f, V] = b0 * uvs[t, 0, 1] + b1 * uvs[t, 1, 1] + b2 * uvs[t, 2, 1]
        places[f, LEVEL] = b0 * shades[i, 0] + b1 * shades[j, 0] + b2 * shades[k, 0]
        places[f, BRIGHTNESS] = b0 * shades[i, 1] + b1 * shades[j, 1] + b2 * shades[k, 1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _add_colours(
    triangles: Array,
    surface: Surface,
    pyramids: Pyramids,
    fragments: Fragments,
    count: int,
    places: Array,
    colours: Array,
) -> None:
    """[Pighin 2002] eq. (5): add to every pixel its fragments' weighted sums of the textures."""
    shades, mixed = surface.shades, surface.mixed
    for f in range(count):
        t = fragments.triangles[f]
        b0, b1, b2 = places[f, B0], places[f, B1], places[f, B2]
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        fine, coarse = place_lookup(pyramids, places[f, U], places[f, V], places[f, LEVEL])
        red, green, blue = 0.0, 0.0, 0.0
        for n in range(surface.mixes[t]):
            c = 2 + mixed[t, n]
            weight = b0 * shades[i, c] + b1 * shades[j, c] + b2 * shades[k, c]
            r, g, b = weighted_texels(pyramids.texels, mixed[t, n], fine, coarse)
            red, green, blue = red + weight * r, green + weight * g, blue + weight * b
        col, share = fragments.columns[f], fragments.shares[f]
        colours[col, 0] += share * places[f, BRIGHTNESS] * red
        colours[col, 1] += share * places[f, BRIGHTNESS] * green
        colours[col, 2] += share * places[f, BRIGHTNESS] * blue
        colours[col, 3] += share


@njit(cache=True, nogil=True, error_model="numpy")
def _write_row(colours: Array, columns: range, pixels: Array, left: int) -> None:
    for col in columns:
        alpha = colours[col, 3]
        whole = 1.0 / max(alpha, np.float32(1e-3))
        for c in range(3):
            pixels[left + col, c] = min(max(np.rint(colours[col, c] * whole), 0.0), 255.0)
        pixels[left + col, 3] = np.rint(alpha * 255.0)
