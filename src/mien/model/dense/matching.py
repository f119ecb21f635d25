"""One photo matched with another through the head's surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.mesh import Mesh
from mien.model.dense.crops import Crop
from mien.numeric.flow import local_correlation, match_images, normalize_contrast
from mien.numeric.raster import interpolate

KEPT_DETAIL_MM = 10.0
"""Patterns larger than this are taken for shading and removed before matching."""
LEAST_FACING = 0.25
"""Cosine between the surface's normal and the direction to the camera."""
ROUND_TRIP_PX = 1.0
"""From a to b and back: a match that returns farther off is wrong."""
LEAST_CORRELATION = 0.6
_BEHIND_PX, _BEHIND_MM = 4.0, 3.0
"""A point this far behind the depth map of another view is hidden there."""
_FEW = 100
"""Pixels that two views must share for a match to be tried."""


@dataclass(frozen=True)
class Sight:
    """A crop with the surface behind its pixels.

    Attributes:
        points: (H, W, 3) mm. facing: (H, W) cosine between normal and direction to the camera.
        usable: (H, W) where the head is seen squarely enough.
    """

    crop: Crop
    points: Float[Array, "h w 3"]
    facing: Float[Array, "h w"]
    usable: Bool[Array, "h w"]

    @classmethod
    def of(cls, crop: Crop, mesh: Mesh, normals: Float[Array, "v 3"]) -> Sight:
        both = np.concatenate([mesh.vertices, normals], axis=1)
        at = interpolate(crop.raster, mesh.triangles, both)
        points, normal = at[..., :3], at[..., 3:]
        to_camera = crop.camera.center - points
        facing = (to_camera * normal).sum(-1) / np.maximum(
            np.linalg.norm(to_camera, axis=-1) * np.linalg.norm(normal, axis=-1), 1e-9
        )
        return cls(crop, points, facing, crop.raster.mask & (facing > LEAST_FACING))


@dataclass(frozen=True)
class Match:
    """Where the pixels of crop a lie in crop b.

    Attributes:
        places: (H, W, 2) px of crop b. good: (H, W) seen in both and alike.
    """

    places: Float[Array, "h w 2"]
    good: Bool[Array, "h w"]


def match_sights(a: Sight, b: Sight) -> Match | None:
    import cv2

    predicted, shared = _predict(a, b)
    if np.count_nonzero(shared) < _FEW:
        return None
    drawn = _sample(b.crop.grey, predicted)
    radius = KEPT_DETAIL_MM * a.crop.camera.focal_px / float(a.crop.camera.t_cam_head[2])
    ours = normalize_contrast(a.crop.grey, shared, radius / 2)
    theirs = normalize_contrast(drawn, shared, radius / 2)
    flow = match_images(ours, theirs)
    rows, columns = np.mgrid[: shared.shape[0], : shared.shape[1]].astype(np.float32)
    moved = np.stack([columns + flow[..., 0] + 0.5, rows + flow[..., 1] + 0.5], axis=-1)
    alike = local_correlation(ours, _sample(theirs, moved)) > LEAST_CORRELATION
    within = _sample(shared.astype(np.float32), moved) > 0.99
    inside = cv2.erode(shared.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return Match(_sample(predicted, moved), alike & within & inside)


def _predict(a: Sight, b: Sight) -> tuple[Float[Array, "h w 2"], Bool[Array, "h w"]]:
    """Where b sees the surface behind a's pixels, and which of them both see."""
    camera = b.crop.camera
    shape = a.usable.shape
    flat = a.points.reshape(-1, 3)
    in_camera = camera.to_camera(flat)
    depth = in_camera[:, 2].reshape(shape)
    places = (camera.focal_px * in_camera[:, :2] / np.maximum(in_camera[:, 2:], 1e-6)) + (
        camera.principal
    )
    predicted = places.reshape(*shape, 2).astype(np.float32)
    nearest = _sample(np.where(b.crop.raster.mask, b.crop.raster.depth, 0), predicted, nearest=True)
    slack = max(_BEHIND_MM, _BEHIND_PX * float(camera.t_cam_head[2]) / camera.focal_px)
    facing = _sample(b.facing, predicted, nearest=True)
    x, y = predicted[..., 0], predicted[..., 1]
    within = (x > 1) & (x < camera.width - 1) & (y > 1) & (y < camera.height - 1)
    shared: Array = a.usable & within & (depth < nearest + slack) & (facing > LEAST_FACING)
    return predicted, shared


def check_match(there: Match, back: Match) -> tuple[Match, Float[Array, "h w"]]:
    """The match and by how many px of a the way back misses; what misses too far is no good."""
    returned = _sample(back.places, there.places)
    rows, columns = np.mgrid[: returned.shape[0], : returned.shape[1]] + 0.5
    miss = np.hypot(returned[..., 0] - columns, returned[..., 1] - rows)
    good = there.good & (_sample(back.good.astype(np.float32), there.places) > 0.99)
    return Match(there.places, good & (miss < ROUND_TRIP_PX)), miss


def _sample(
    values: Float[Array, "h w ..."], places: Float[Array, "h w 2"], *, nearest: bool = False
) -> Float[Array, "h w ..."]:
    """Values at places in px; 0 outside of the image."""
    import cv2

    found: Array = cv2.remap(
        np.asarray(values, np.float32),
        places[..., 0].astype(np.float32) - 0.5,
        places[..., 1].astype(np.float32) - 0.5,
        cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    return found
