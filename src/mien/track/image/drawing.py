"""The face rendered for comparison with a frame: one picture for each expression, and the mixture.

Source:
    [Pighin 2002] eq. 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mien.arrays import Array, Bool, Float, Int, frozen
from mien.numeric.kernels.jit import njit
from mien.numeric.kernels.threads import for_row_bands
from mien.numeric.raster.rasterizer import Raster, empty_raster, rasterize_rows
from mien.render.mipmap import Four, Pyramids, level_of_detail, place_lookup, weighted_texels
from mien.render.multitexture import TexturedMesh
from mien.rig.state import PosedFace
from mien.track.image.frame_pyramid import FrameCrop, Intrinsics
from mien.track.image.greyscale import GreyPyramids, add_greys

_Corners = tuple[int, int, int]
_Barycentrics = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """Where the head is.

    Attributes:
        R: (3, 3) R_cam_head.
        t: (3,) mm, t_cam_head.
        zoom: focal length over that of the crops it is drawn for.
    """

    R: Float[Array, "3 3"]
    t: Float[Array, " 3"]
    zoom: float = 1.0


class Drawing(NamedTuple):
    """The model, rendered for one crop of a frame.

    Attributes:
        ids: (h, w) triangles, -1 where there is none that is compared.
        barycentrics: (h, w, 3).
        depth: (h, w) mm.
        positions: (V, 3) mm, of the vertices in camera space.
        mask: (h, w) float32, 1 where there is a triangle that is compared.
        layers: (h, w, K) float32, 0 to 255: luma of each expression's texture, on one geometry.
        luma: (h, w) float32: of their mixture, [Pighin 2002] eq. (5).
    """

    ids: Int[Array, "h w"]
    barycentrics: Float[Array, "h w 3"]
    depth: Float[Array, "h w"]
    positions: Float[Array, "v 3"]
    mask: Float[Array, "h w"]
    layers: Float[Array, "h w k"]
    luma: Float[Array, "h w"]


def draw(
    painted: TexturedMesh,
    grey: GreyPyramids,
    compared: Bool[Array, " f"],
    face: PosedFace,
    pose: Pose,
    crop: FrameCrop,
    *,
    layers: bool = True,
) -> Drawing:
    """The face in shades of grey, at the crop's size.

    Args:
        painted: triangles and their textures.
        grey: the same textures in grey.
        compared: which triangles are compared with the frame.
        face: its vertices, blending weights and brightness.
        pose: of the head.
        crop: gives size and intrinsics.
        layers: keep every expression's rendering; otherwise there are 0 of them.
    """
    projected = _projected(painted, compared, face, pose, crop)
    ids, barycentrics = projected.raster.triangle_ids, projected.raster.barycentrics
    count = face.weights.shape[1] if layers else 0
    out, luma = np.empty((*ids.shape, count), np.float32), np.empty(ids.shape, np.float32)
    mask = np.empty(ids.shape, np.float32)

    def rows(first: int, end: int) -> None:
        projected.rasterize(first, end)
        _shade_rows(ids, barycentrics, projected.surface, grey, first, end, mask, out, luma)

    for_row_bands(rows, len(ids), work=projected.work)
    return Drawing(ids, barycentrics, projected.raster.depth, projected.positions, mask, out, luma)


def draw_colours(
    painted: TexturedMesh, compared: Bool[Array, " f"], face: PosedFace, pose: Pose, crop: FrameCrop
) -> tuple[Float[Array, "h w 3"], Float[Array, "h w"]]:
    """The mixture in colour, 0 to 255, and a mask of the compared triangles."""
    projected = _projected(painted, compared, face, pose, crop)
    ids, barycentrics = projected.raster.triangle_ids, projected.raster.barycentrics
    out, mask = np.empty((*ids.shape, 3), np.float32), np.empty(ids.shape, np.float32)

    def rows(first: int, end: int) -> None:
        projected.rasterize(first, end)
        _colour_rows(ids, barycentrics, projected.surface, painted.pyramids, first, end, mask, out)

    for_row_bands(rows, len(ids), work=projected.work)
    return out, mask


class _Surface(NamedTuple):
    """Triangles and what shading needs of them.

    Attributes:
        compared: (F,) bool.
        triangles: (F, 3).
        uvs: (F, 3, 2) of every triangle's corners.
        shades: (V, 2 + K) float32 level of detail, brightness, weight of every texture.
    """

    compared: Bool[Array, " f"]
    triangles: Int[Array, "f 3"]
    uvs: Float[Array, "f 3 2"]
    shades: Float[Array, "v s"]


@dataclass(frozen=True)
class _Projected:
    """A face in front of a camera.

    Attributes:
        surface: of its triangles.
        positions: (V, 3) mm, camera space.
        points: (V, 2) px.
        depth: (V,) mm.
        raster: triangles by pixel, in the rows that `rasterize` has filled in.
    """

    surface: _Surface
    positions: Float[Array, "v 3"]
    points: Float[Array, "v 2"]
    depth: Float[Array, " v"]
    raster: Raster

    @property
    def work(self) -> int:
        """Cost of all rows, in pixels (numeric.kernels.threads)."""
        return 2 * len(self.surface.triangles) + 3 * self.raster.triangle_ids.size

    def rasterize(self, first: int, end: int) -> None:
        """Fill in rows of the raster."""
        mesh, raster = (self.points, self.depth, self.surface.triangles), self.raster
        outputs = (raster.triangle_ids, raster.barycentrics, raster.depth)
        rasterize_rows(*mesh, True, first, end, *outputs)


def _projected(
    painted: TexturedMesh, compared: Bool[Array, " f"], face: PosedFace, pose: Pose, crop: FrameCrop
) -> _Projected:
    """The face in front of the crop's camera, not rasterized yet."""
    count, textures = face.weights.shape
    positions, points, depth = np.empty((count, 3)), np.empty((count, 2)), np.empty(count)
    motion = np.empty((3, 4))
    motion[:, :3], motion[:, 3] = pose.R, pose.t
    intrinsics = crop.intrinsics(pose.zoom)
    shades = np.empty((count, 2 + textures), np.float32)
    inputs = (face.vertices, face.brightness, face.weights)
    _project_vertices(*inputs, motion, intrinsics, positions, points, depth, shades)
    # As sharp as a picture of four samples a pixel (render.multitexture).
    shades[:, 0] = level_of_detail(painted.texels, points, painted.triangles) - 0.5
    surface = _Surface(compared, painted.triangles, painted.uvs, shades)
    return _Projected(surface, positions, frozen(points), frozen(depth), empty_raster(*crop.size))


@njit(cache=True, nogil=True, error_model="numpy")
def _project_vertices(
    vertices: Array,
    brightness: Array,
    weights: Array,
    motion: Array,
    intrinsics: Intrinsics,
    positions: Array,
    points: Array,
    depth: Array,
    shades: Array,
) -> None:
    """Fill in vertices in camera space, their projections, and shades but for the level of detail.

    Args:
        vertices: (V, 3) mm, head space.
        brightness: (V,).
        weights: (V, K) of the textures.
        motion: (3, 4) from head to camera space.
        intrinsics: of the camera.
        positions: (V, 3) mm, camera space; filled in.
        points: (V, 2) px; filled in.
        depth: (V,) mm; filled in.
        shades: of _Surface; filled in but for the first column.
    """
    focal, cx, cy = intrinsics
    for v in range(len(vertices)):
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        for axis in range(3):
            m = motion[axis]
            positions[v, axis] = m[0] * x + m[1] * y + m[2] * z + m[3]
        depth[v] = positions[v, 2]
        points[v, 0] = focal * positions[v, 0] / depth[v] + cx
        points[v, 1] = focal * positions[v, 1] / depth[v] + cy
        shades[v, 1] = brightness[v]
        for n in range(weights.shape[1]):
            shades[v, 2 + n] = weights[v, n]


@njit(inline="always")
def _interpolated(shades: Array, corners: _Corners, b: _Barycentrics, column: int) -> float:
    """One column of the shades, interpolated in a triangle."""
    i, j, k = corners
    return b[0] * shades[i, column] + b[1] * shades[j, column] + b[2] * shades[k, column]


@njit(inline="always")
def _lookup(
    surface: _Surface,
    t: int,
    corners: _Corners,
    b: _Barycentrics,
    pyramids: Pyramids | GreyPyramids,
    dropped: int,
) -> tuple[Four, Four, float]:
    """Texels and their weights for a point in a triangle, and its brightness."""
    uvs, shades = surface.uvs, surface.shades
    u = b[0] * uvs[t, 0, 0] + b[1] * uvs[t, 1, 0] + b[2] * uvs[t, 2, 0]
    v = b[0] * uvs[t, 0, 1] + b[1] * uvs[t, 1, 1] + b[2] * uvs[t, 2, 1]
    level = _interpolated(shades, corners, b, 0)
    fine, coarse = place_lookup(pyramids, u, v, level - dropped)
    return fine, coarse, _interpolated(shades, corners, b, 1)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _shade_rows(
    ids: Array,
    barycentrics: Array,
    surface: _Surface,
    grey: GreyPyramids,
    first: int,
    end: int,
    mask: Array,
    layers: Array,
    luma: Array,
) -> None:
    """Fill in mask, layers and luma; ids that are not compared become -1."""
    greys = np.empty(grey.texels.shape[1], np.float32)
    mask[first:end] = 0.0
    layers[first:end] = 0.0
    luma[first:end] = 0.0
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0 or not surface.compared[t]:
                ids[row, col] = -1
                continue
            b = barycentrics[row, col, 0], barycentrics[row, col, 1], barycentrics[row, col, 2]
            corners = surface.triangles[t, 0], surface.triangles[t, 1], surface.triangles[t, 2]
            fine, coarse, bright = _lookup(surface, t, corners, b, grey, grey.dropped)
            add_greys(grey.texels, fine, coarse, greys)
            total = np.float32(0.0)
            for n in range(len(greys)):
                total += _interpolated(surface.shades, corners, b, 2 + n) * greys[n]
            for n in range(layers.shape[2]):
                layers[row, col, n] = bright * greys[n]
            luma[row, col] = bright * total
            mask[row, col] = 1.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _colour_rows(
    ids: Array,
    barycentrics: Array,
    surface: _Surface,
    pyramids: Pyramids,
    first: int,
    end: int,
    mask: Array,
    out: Array,
) -> None:
    """Fill in mask and mixture."""
    mask[first:end] = 0.0
    out[first:end] = 0.0
    for row in range(first, end):
        for col in range(ids.shape[1]):
            t = ids[row, col]
            if t < 0 or not surface.compared[t]:
                continue
            b = barycentrics[row, col, 0], barycentrics[row, col, 1], barycentrics[row, col, 2]
            corners = surface.triangles[t, 0], surface.triangles[t, 1], surface.triangles[t, 2]
            fine, coarse, bright = _lookup(surface, t, corners, b, pyramids, 0)
            for n in range(len(pyramids.texels)):
                weight = bright * _interpolated(surface.shades, corners, b, 2 + n)
                if weight != 0.0:
                    red, green, blue = weighted_texels(pyramids.texels, n, fine, coarse)
                    out[row, col, 0] += weight * red
                    out[row, col, 1] += weight * green
                    out[row, col, 2] += weight * blue
            mask[row, col] = 1.0
