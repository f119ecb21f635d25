"""One photo matched with another through the head's surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float, Shaped
from mien.mesh import Mesh
from mien.numeric.images.optical_flow import local_correlation, normalize_contrast, optical_flow
from mien.numeric.kernels.threads import run_concurrently
from mien.numeric.raster.rasterizer import interpolate
from mien.reconstruction.dense.crops import Crop

KEPT_DETAIL_MM = 10.0
"""Patterns larger than this are taken for shading and removed before matching."""
MIN_FACING = 0.25
"""Cosine between the surface's normal and the direction to the camera."""
ROUND_TRIP_PX = 1.0
"""From a to b and back: a match that returns farther off is wrong."""
MIN_CORRELATION = 0.6
_BEHIND_PX, _BEHIND_MM = 4.0, 3.0
"""A point this far behind the depth map of another view is hidden there."""
_FEW = 100
"""Pixels that two views must share for a match to be tried."""
_MARGIN_PX = 8
"""Around what two views share: as much as is matched at once."""
_EDGE_PX = 2
"""At the edge of a crop, where interpolation lacks neighbours."""
_ALL = 0.99
"""A mask interpolated between its pixels: all of them are in it."""


@dataclass(frozen=True)
class SurfaceCrop:
    """A crop with the surface behind its pixels.

    Attributes:
        points: (H, W, 3) mm.
        facing: (H, W) cosine between normal and direction to the camera.
        usable: (H, W) where the head is seen squarely enough.
    """

    crop: Crop
    points: Float[Array, "h w 3"]
    facing: Float[Array, "h w"]
    usable: Bool[Array, "h w"]

    @classmethod
    def of(cls, crop: Crop, mesh: Mesh, normals: Float[Array, "v 3"]) -> SurfaceCrop:
        """The surface of a mesh as the crop's camera sees it."""
        both = np.concatenate([mesh.vertices, normals], axis=1)
        at = interpolate(crop.raster, mesh.triangles, both)
        points, normal = np.ascontiguousarray(at[..., :3]), at[..., 3:]
        towards = crop.camera.center.astype(np.float32) - points
        lengths = np.sqrt(_dot(towards, towards) * _dot(normal, normal))
        facing = _dot(towards, normal) / np.maximum(lengths, 1e-9)
        return cls(crop, points, facing, crop.raster.mask & (facing > MIN_FACING))


@dataclass(frozen=True)
class Match:
    """Where the pixels of crop a lie in crop b.

    Attributes:
        points: (H, W, 2) px of crop b.
        valid: (H, W) seen in both and alike.
    """

    points: Float[Array, "h w 2"]
    valid: Bool[Array, "h w"]


CheckedMatch = tuple[Match, Float[Array, "h w"]]
"""A match and by how many px the way back misses."""


def match_crops(a: SurfaceCrop, b: SurfaceCrop, *, fine: bool = False) -> Match | None:
    """Where b shows what each pixel of a shows; None where they share next to nothing.

    Photo b is drawn through the surface as a's camera would see it, which takes out pose and
    foreshortening but for the errors of cameras and surface: those are what is matched.
    """
    import cv2

    predicted, shared = _predict(a, b)
    if np.count_nonzero(shared) < _FEW:
        return None
    window = _around(shared)
    there, mask = predicted[window], shared[window]
    radius = KEPT_DETAIL_MM / 2 * a.crop.camera.focal_px / float(a.crop.camera.t_cam_head[2])
    ours = normalize_contrast(a.crop.grey[window], mask, radius)
    theirs = normalize_contrast(_sample(b.crop.grey, there, cv2.INTER_CUBIC), mask, radius)
    moved = optical_flow(ours, theirs, fine=fine) + _centres(mask)
    alike = local_correlation(ours, _sample(theirs, moved)) > MIN_CORRELATION
    within = _sample(mask.astype(np.float32), moved) > _ALL
    inside = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    points, valid = np.zeros_like(predicted), np.zeros_like(shared)
    points[window], valid[window] = _sample(there, moved), alike & within & inside
    return Match(points, valid)


def match_both(
    a: SurfaceCrop, b: SurfaceCrop, *, fine: bool = False
) -> tuple[CheckedMatch, CheckedMatch] | None:
    """Pixels of a in b and of b in a, checked by each other; None where they share nothing.

    Args:
        a: one photo.
        b: the other.
        fine: as in optical_flow.
    """
    there, back = run_concurrently(
        lambda: match_crops(a, b, fine=fine), lambda: match_crops(b, a, fine=fine)
    )
    if there is None or back is None:
        return None
    return check_match(there, back), check_match(back, there)


def check_match(there: Match, back: Match) -> CheckedMatch:
    """The match and by how many px of a the way back misses; what misses too far is invalid."""
    off = _sample(back.points, there.points) - _centres(there.valid)
    miss = np.hypot(off[..., 0], off[..., 1])
    valid = there.valid & (_sample(back.valid.astype(np.float32), there.points) > _ALL)
    return Match(there.points, valid & (miss < ROUND_TRIP_PX)), miss


def _predict(a: SurfaceCrop, b: SurfaceCrop) -> tuple[Float[Array, "h w 2"], Bool[Array, "h w"]]:
    """Where b sees the surface behind a's pixels, and which of them both see."""
    import cv2

    camera = b.crop.camera
    # Single precision is valid to 1e-4 px.
    in_camera = cv2.transform(a.points, np.column_stack([camera.R_cam_head, camera.t_cam_head]))
    depth = np.maximum(in_camera[..., 2], 1.0)
    scale = np.float32(camera.focal_px) / depth
    x, y = (in_camera[..., i] * scale + np.float32(camera.principal[i]) for i in range(2))
    predicted = np.stack([x, y], axis=-1)
    nearest = _sample(b.crop.raster.depth, predicted, cv2.INTER_NEAREST)
    facing = _sample(b.facing, predicted, cv2.INTER_NEAREST)
    slack = max(_BEHIND_MM, _BEHIND_PX * float(camera.t_cam_head[2]) / camera.focal_px)
    within = (x > _EDGE_PX) & (x < camera.width - _EDGE_PX)
    within &= (y > _EDGE_PX) & (y < camera.height - _EDGE_PX)
    shared: Array = a.usable & within & (depth < nearest + slack) & (facing > MIN_FACING)
    return predicted, shared


def _around(mask: Bool[Array, "h w"]) -> tuple[slice, slice]:
    """The rows and columns that hold all of the mask, and a margin."""
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(rows[0] - _MARGIN_PX, 0), min(rows[-1] + 1 + _MARGIN_PX, height)),
        slice(max(columns[0] - _MARGIN_PX, 0), min(columns[-1] + 1 + _MARGIN_PX, width)),
    )


def _centres(image: Shaped[Array, "h w"]) -> Float[Array, "h w 2"]:
    """Of its pixels, px."""
    height, width = image.shape
    x, y = np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32)
    return np.stack(np.meshgrid(x + 0.5, y + 0.5), axis=-1)


def _dot(a: Float[Array, "h w 3"], b: Float[Array, "h w 3"]) -> Float[Array, "h w"]:
    return np.einsum("hwi,hwi->hw", a, b)


def _sample(
    values: Float[Array, "h w ..."], points: Float[Array, "h w 2"], how: int = 1
) -> Float[Array, "h w ..."]:
    """Values at points in px, 0 outside of the image; `how` is one of OpenCV's interpolations."""
    import cv2

    return cv2.remap(
        np.asarray(values, np.float32),
        points.astype(np.float32) - np.float32(0.5),
        None,
        how,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
