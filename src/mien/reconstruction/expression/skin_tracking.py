"""Skin of the neutral photos found again in an expression's photos."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.mesh import Mesh
from mien.numeric.raster.rasterizer import interpolate
from mien.numeric.rotation import angle_between
from mien.reconstruction.dense.crops import crop_view, finest_mm_per_px, visible_mesh
from mien.reconstruction.dense.matching import SurfaceCrop, match_both
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.observations import SurfaceObservations

MATCHED_SIGMA_MM = 0.4
"""Standard deviation of matched skin, whose look changes with wrinkles and light."""
_POINTS = 1500
_PATCH_PX, _MIN_STEP_PX = 8, 2
"""Side of what is matched at once, and how near to each other two points are followed at most."""


def track_skin(
    view: CapturedView,
    camera: Camera,
    vertices: Float[Array, "v 3"],
    known: KnownHead,
    *,
    photo: int,
    mm_per_px: float,
) -> SurfaceObservations | None:
    """Places of the neutral head's skin where the expression's photo shows them.

    The neutral photo that looks from the nearest side is drawn as the expression's camera would
    see it, each point of the skin moved to where the expression has it so far; dense matching then
    measures what is left.

    Args:
        view: a photo of the expression.
        camera: of the photo.
        vertices: (V, 3) mm, the expression as known so far.
        known: the neutral head.
        photo: number of the view among the expression's photos.
        mm_per_px: scale at which to match.

    Returns:
        None where too little matches.
    """
    nearest = _nearest(camera, known)
    still = visible_mesh(known.generic, known.vertices)
    moved = visible_mesh(known.generic, vertices)
    scale = max(mm_per_px, finest_mm_per_px([camera, known.cameras[nearest]]))
    here = _surface_crop(view, camera, moved, still, scale)
    there = _surface_crop(known.views[nearest], known.cameras[nearest], still, moved, scale)
    if here is None or there is None:
        return None
    matches = match_both(there, here)
    if matches is None:
        return None
    match, _ = matches[0]
    rows, columns, step = _grid(match.valid)
    if not len(rows):
        return None
    raster = there.crop.raster
    corners = still.triangles[raster.triangle_ids[rows, columns]]
    steady = _rigid_skin(known.generic)[corners].all(axis=1)
    rows, columns, corners = rows[steady], columns[steady], corners[steady]
    return SurfaceObservations(
        corners=corners,
        barycentrics=raster.barycentrics[rows, columns].astype(np.float64),
        offset=np.zeros((len(rows), 3)),
        photo=np.full(len(rows), photo),
        image_points=here.crop.to_photo(match.points[rows, columns]),
        # Places that share a patch of the matching share its error.
        sigma_mm=np.full(len(rows), MATCHED_SIGMA_MM * max(1.0, _PATCH_PX / step)),
    )


def _rigid_skin(generic: GenericHead) -> Bool[Array, " v"]:
    """(V,) skin that goes with the head: the neck turns by itself, hair has no surface."""
    regions = generic.regions
    excluded = regions["neck"] + regions["scalp"] + regions["left_ear"] + regions["right_ear"]
    return (regions["face"] > 0) & (excluded < 0.5) & (regions["eye_socket"] < 1)


def _nearest(camera: Camera, known: KnownHead) -> int:
    """The neutral photo that shows a face from the side nearest to this camera's."""
    turned = [
        float(angle_between(camera.R_cam_head, other.R_cam_head)) if view.marked else np.inf
        for view, other in zip(known.views, known.cameras, strict=True)
    ]
    return int(np.argmin(turned))


def _surface_crop(
    view: CapturedView, camera: Camera, mesh: Mesh, other: Mesh, scale: float
) -> SurfaceCrop | None:
    """The photo's view of a mesh, its points where the other mesh has them."""
    crop = crop_view(view, camera, mesh, scale)
    if crop is None:
        return None
    surface_crop = SurfaceCrop.of(crop, mesh, mesh.vertex_normals())
    return replace(surface_crop, points=interpolate(crop.raster, mesh.triangles, other.vertices))


def _grid(valid: Bool[Array, "h w"]) -> tuple[Int[Array, " n"], Int[Array, " n"], int]:
    """Rows and columns of evenly spread pixels that are valid, and how many px they are apart."""
    step = max(_MIN_STEP_PX, int(np.sqrt(np.count_nonzero(valid) / _POINTS)))
    rows, columns = np.nonzero(valid[step // 2 :: step, step // 2 :: step])
    return rows * step + step // 2, columns * step + step // 2, step
