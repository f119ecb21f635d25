"""A fitted mesh and feature points drawn over a photo."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Int, UInt8, check_image
from mien.camera import Camera
from mien.errors import InputError
from mien.mesh import Mesh
from mien.render.projection import project_safely
from mien.render.shade import rasterize_mesh, shown_parts

# OpenCV draws at fractions of a pixel given as integers with this many bits behind the point.
_SHIFT = 4


def overlay_mesh(
    photo: UInt8[Array, "h w 3"],
    mesh: Mesh,
    camera: Camera,
    *,
    parts: tuple[str, ...] | None = None,
    colour: tuple[int, int, int] = (90, 220, 255),
    opacity: float = 0.6,
) -> UInt8[Array, "h w 3"]:
    """The photo with the mesh's visible edges as thin lines over it.

    Args:
        photo: (H, W, 3).
        mesh: to be drawn.
        camera: of the photo.
        parts: names of the parts to draw; by default those that pictures show.
        colour: sRGB of the lines.
        opacity: from 0 to 1.

    Raises:
        InputError: a photo of another size than the camera's.
    """
    import cv2

    photo = check_image("photo", photo)
    if photo.shape[:2] != (camera.height, camera.width):
        expected = f"{camera.width}x{camera.height} px as its camera says"
        raise InputError("photo", expected, f"{photo.shape[1]}x{photo.shape[0]}")
    shown = mesh.submesh(mesh.triangles_of(*(shown_parts(mesh) if parts is None else parts)))
    ends = project_safely(shown.vertices, camera)[_visible_edges(shown, camera)]
    drawn = np.ascontiguousarray(photo)
    if drawn is photo:
        drawn = photo.copy()
    cv2.polylines(drawn, list(_fixed_point(ends)), False, colour, 1, cv2.LINE_AA, _SHIFT)
    return cv2.addWeighted(drawn, opacity, photo, 1 - opacity, 0)


def _visible_edges(mesh: Mesh, camera: Camera) -> Int[Array, "e 2"]:
    """Vertex pairs, each once, of visible triangles that face the camera."""
    raster = rasterize_mesh(mesh, camera)
    seen = np.unique(raster.triangle_ids[raster.mask])
    facing = camera.center - mesh.vertices[mesh.triangles[seen, 0]]
    seen = seen[np.einsum("fc,fc->f", facing, mesh.triangle_normals()[seen]) > 0]
    triangles = mesh.triangles[seen]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(np.sort(edges, axis=1), axis=0)


def _fixed_point(points: Array) -> Int[Array, "*n 2"]:
    """OpenCV puts the first pixel's centre at 0, not at 0.5."""
    return np.rint((points - 0.5) * 2**_SHIFT).astype(np.int32)
