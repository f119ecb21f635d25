"""Rasterization with several textures, blended by weights at the vertices, in one pass.

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


class TexturedMesh(NamedTuple):
    """Triangles and their textures, which do not depend on the pose of the face.

    Attributes:
        triangles: (F, 3) vertex indices.
        uvs: (F, 3, 2) of every triangle's corners.
        texels: (F,) area of each triangle in texels.
        pyramids: of the textures.
    """

    triangles: Int[Array, "f 3"]
    uvs: Float[Array, "f 3 2"]
    texels: Float[Array, " f"]
    pyramids: Pyramids


class ShadedTriangles(NamedTuple):
    """Appearance of the triangles in one picture.

    Attributes:
        uvs: (F, 3, 2) of every triangle's corners.
        vertex_values: (V, 2 + K) level of detail, brightness, weight of every texture.
        texture_ids: (F, K) textures with weight in a triangle, in the first columns.
        texture_counts: (F,) how many these are.
    """

    uvs: Float[Array, "f 3 2"]
    vertex_values: Float[Array, "v s"]
    texture_ids: Int[Array, "f k"]
    texture_counts: Int[Array, " f"]


def prepare_textured_mesh(mesh: Mesh, pyramids: Pyramids) -> TexturedMesh:
    """The mesh's triangles. Raises: InputError: a mesh without texture coordinates."""
    if len(mesh.uv_triangles) == 0:
        raise InputError("mesh", "one with texture coordinates", "one without")
    corners = mesh.uvs[mesh.uv_triangles]
    texels = texel_areas(corners, pyramids)
    arrays = (mesh.triangles, corners.astype(np.float32), texels)
    triangles, uvs, texels = (frozen(np.ascontiguousarray(array)) for array in arrays)
    return TexturedMesh(triangles, uvs, texels, pyramids)


def draw_multitextured(
    mesh: TexturedMesh,
    vertices: Float[Array, "v 3"],
    weights: Float[Array, "v k"],
    brightness: Float[Array, " v"],
    camera: Camera,
    factor: int,
) -> UInt8[Array, "h w 4"]:
    """(H, W, 4) sRGB, straight alpha: textures blended by weights, times brightness.

    Edges get factor x factor samples a pixel; a triangle is looked up once in each pixel.
    """
    large = camera.resized(factor)
    points, depth = project_safely(vertices, large), large.to_camera(vertices)[:, 2]
    coverage = prepare_coverage(points, depth, mesh.triangles, large.width, large.height)
    shaded = _shaded_triangles(mesh, points, weights, brightness, factor)
    image = np.zeros((camera.height, camera.width, 4), np.uint8)

    def strips(first: int, end: int) -> None:
        _draw_strips(coverage, shaded, mesh.pyramids, factor, first, end, image)

    for_row_bands(strips, len(coverage.starts) // 2, work=large.width * large.height)
    return image


def _shaded_triangles(
    mesh: TexturedMesh, points: Array, weights: Array, brightness: Array, factor: int
) -> ShadedTriangles:
    detail = level_of_detail(mesh.texels, points, mesh.triangles)
    # One lookup a pixel, with a filter as wide as that of a lookup at every sample.
    detail += np.log2(factor) + 0.5 * np.log2((1 + 2 / factor**2) / 3)
    faces, textures = len(mesh.triangles), weights.shape[1]
    vertex_values = np.empty((len(points), 2 + textures), np.float32)
    vertex_values[:, 0], vertex_values[:, 1], vertex_values[:, 2:] = detail, brightness, weights
    texture_ids, texture_counts = np.empty((faces, textures), np.int32), np.zeros(faces, np.int32)
    _list_textures(mesh.triangles, vertex_values, texture_ids, texture_counts)
    return ShadedTriangles(mesh.uvs, vertex_values, texture_ids, texture_counts)


@njit(cache=True, nogil=True)
def _list_textures(
    triangles: Array, vertex_values: Array, texture_ids: Array, texture_counts: Array
) -> None:
    for t in range(len(triangles)):
        for texture in range(texture_ids.shape[1]):
            c = 2 + texture
            i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            if (
                vertex_values[i, c] != 0.0
                or vertex_values[j, c] != 0.0
                or vertex_values[k, c] != 0.0
            ):
                texture_ids[t, texture_counts[t]] = texture
                texture_counts[t] += 1


class Fragments(NamedTuple):
    """The fragments of a row of pixels: each triangle in each pixel once.

    Attributes:
        triangles: indices into those of the coverage.
        columns: of the pixels, counted from the first of the coverage.
        x: mean of the samples that show the triangle, in the strip.
        y: mean of the samples that show the triangle, in the strip.
        coverages: fraction of the pixel's samples.
    """

    triangles: Int[Array, " n"]
    columns: Int[Array, " n"]
    x: Float[Array, " n"]
    y: Float[Array, " n"]
    coverages: Float[Array, " n"]


@njit(cache=True, nogil=True, error_model="numpy")
def _draw_strips(
    coverage: Coverage,
    shaded: ShadedTriangles,
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
    attributes = np.empty((most, 7))
    colours = np.empty((coverage.width // factor, 4), np.float32)
    for strip in range(first, end):
        first_sample, end_sample = cover_strip(coverage, strip, ids, nearest)
        columns = range(first_sample // factor, (end_sample + factor - 1) // factor)
        for line in range(0, STRIP, factor):
            row = (strip * STRIP + line) // factor
            if row == len(image):
                break
            count = _list_fragments(ids, line, columns, factor, fragments)
            _interpolate_attributes(coverage, shaded, fragments, strip, count, attributes)
            colours[:] = 0.0
            _add_colours(
                coverage.triangles, shaded, pyramids, fragments, count, attributes, colours
            )
            _write_row(colours, columns, image[row], left)


@njit(cache=True, nogil=True, error_model="numpy")
def _list_fragments(
    ids: Array, line: int, columns: range, factor: int, fragments: Fragments
) -> int:
    """Fill in the fragments of the pixels whose samples begin in this line; return their number."""
    middle, count = 0.5 * factor, 0
    for col in columns:
        t = ids[line, col * factor]
        alike = True
        for a in range(line, line + factor):
            for b in range(col * factor, (col + 1) * factor):
                alike &= ids[a, b] == t
        if not alike:
            count = _list_partial(ids, line, col, factor, fragments, count)
        elif t >= 0:
            fragments.triangles[count], fragments.columns[count] = t, col
            fragments.x[count], fragments.y[count] = col * factor + middle, line + middle
            fragments.coverages[count] = 1.0
            count += 1
    return count


@njit(inline="always")
def _list_partial(
    ids: Array, line: int, col: int, factor: int, fragments: Fragments, first: int
) -> int:
    """The fragments of one pixel that shows several triangles, or one in a part of it."""
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
                fragments.x[f], fragments.y[f], fragments.coverages[f] = 0.0, 0.0, 0.0
                end += 1
            fragments.x[f] += b + 0.5
            fragments.y[f] += a + 0.5
            fragments.coverages[f] += 1.0
    for f in range(first, end):
        fragments.x[f] /= fragments.coverages[f]
        fragments.y[f] /= fragments.coverages[f]
        fragments.coverages[f] /= factor * factor
    return end


# Columns of the interpolated attributes.
B0, B1, B2, U, V, LEVEL, BRIGHTNESS = range(7)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _interpolate_attributes(
    coverage: Coverage,
    shaded: ShadedTriangles,
    fragments: Fragments,
    strip: int,
    count: int,
    attributes: Array,
) -> None:
    """Fill in barycentrics, texture coordinates, level and brightness of the fragments."""
    triangles, uvs, vertex_values = coverage.triangles, shaded.uvs, shaded.vertex_values
    left, top = coverage.left, strip * STRIP
    for f in range(count):
        t = fragments.triangles[f]
        x, y = left + fragments.x[f], top + fragments.y[f]
        b0, b1, b2 = barycentrics_at(coverage.planes, t, x, y)
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        attributes[f, B0], attributes[f, B1], attributes[f, B2] = b0, b1, b2
        attributes[f, U] = b0 * uvs[t, 0, 0] + b1 * uvs[t, 1, 0] + b2 * uvs[t, 2, 0]
        attributes[f, V] = b0 * uvs[t, 0, 1] + b1 * uvs[t, 1, 1] + b2 * uvs[t, 2, 1]
        attributes[f, LEVEL] = (
            b0 * vertex_values[i, 0] + b1 * vertex_values[j, 0] + b2 * vertex_values[k, 0]
        )
        attributes[f, BRIGHTNESS] = (
            b0 * vertex_values[i, 1] + b1 * vertex_values[j, 1] + b2 * vertex_values[k, 1]
        )


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _add_colours(
    triangles: Array,
    shaded: ShadedTriangles,
    pyramids: Pyramids,
    fragments: Fragments,
    count: int,
    attributes: Array,
    colours: Array,
) -> None:
    """[Pighin 2002] eq. (5): add to every pixel its fragments' weighted sums of the textures."""
    vertex_values, texture_ids = shaded.vertex_values, shaded.texture_ids
    for f in range(count):
        t = fragments.triangles[f]
        b0, b1, b2 = attributes[f, B0], attributes[f, B1], attributes[f, B2]
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        fine, coarse = place_lookup(
            pyramids, attributes[f, U], attributes[f, V], attributes[f, LEVEL]
        )
        red, green, blue = 0.0, 0.0, 0.0
        for n in range(shaded.texture_counts[t]):
            c = 2 + texture_ids[t, n]
            weight = b0 * vertex_values[i, c] + b1 * vertex_values[j, c] + b2 * vertex_values[k, c]
            r, g, b = weighted_texels(pyramids.texels, texture_ids[t, n], fine, coarse)
            red, green, blue = red + weight * r, green + weight * g, blue + weight * b
        col, alpha = fragments.columns[f], fragments.coverages[f]
        colours[col, 0] += alpha * attributes[f, BRIGHTNESS] * red
        colours[col, 1] += alpha * attributes[f, BRIGHTNESS] * green
        colours[col, 2] += alpha * attributes[f, BRIGHTNESS] * blue
        colours[col, 3] += alpha


@njit(cache=True, nogil=True, error_model="numpy")
def _write_row(colours: Array, columns: range, pixels: Array, left: int) -> None:
    for col in columns:
        alpha = colours[col, 3]
        whole = 1.0 / max(alpha, np.float32(1e-3))
        for c in range(3):
            pixels[left + col, c] = min(max(np.rint(colours[col, c] * whole), 0.0), 255.0)
        pixels[left + col, 3] = np.rint(alpha * 255.0)
