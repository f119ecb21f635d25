"""A photo laid over what a known head would look like there, and how well they agree."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.camera import Camera
from mien.numeric.images.optical_flow import local_correlation, normalize_contrast, optical_flow
from mien.reconstruction.localization.camera_refinement import FocalBelief, refine_camera
from mien.reconstruction.localization.gallery import (
    Gallery,
    Painting,
    px_per_mm,
    reduced,
    resized_to,
)

_MARGIN_MM = 20.0
_DETAIL_MM = 2.0
"""Contrast is compared over about this distance: wider shading differs from photo to photo."""
_ALIKE = 0.5
_LEAST_ENERGY = 0.25
"""Of normalized contrast, where a place shows no more than noise: plain skin tells nothing."""
_SPACING_PX = 5
_FEWEST = 30
_SMALLEST_PX = 40


@dataclass(frozen=True)
class Alignment:
    """A painting matched with the photo.

    Attributes:
        painting: as the camera sees it.
        camera: of the painting, which shows a part of the photo.
        shifts: (H, W, 2) px from the painting to the photo.
        alike: (H, W) -1 to 1, how much a place's surroundings look like those that it was matched
            with; 0 where the painting knows nothing.
        telling: (H, W) where the painting knows something and shows some contrast.
    """

    painting: Painting
    camera: Camera
    shifts: Float[Array, "h w 2"]
    alike: Float[Array, "h w"]
    telling: Bool[Array, "h w"]

    @property
    def telling_mm2(self) -> float:
        """Area of the telling part in the picture."""
        return float(np.count_nonzero(self.telling)) / px_per_mm(self.camera) ** 2

    def agreement(self, within_mm: float) -> float:
        """Share of the telling pixels that look alike where they should be, or nearly there."""
        if not self.telling.any():
            return 0.0
        off_mm = np.hypot(self.shifts[..., 0], self.shifts[..., 1]) / px_per_mm(self.camera)
        agrees = (self.alike > _ALIKE) & (off_mm < within_mm)
        return float(agrees[self.telling].mean())


def align(
    photo: UInt8[Array, "h w 3"], camera: Camera, gallery: Gallery, resolution: float
) -> Alignment | None:
    """The photo matched with the head as the camera sees it; None where it hardly does.

    Args:
        camera: of the photo, to within some 20 degrees.
        resolution: px of the painting per mm.
    """
    import cv2

    window = _window(photo, camera, gallery, resolution)
    if window is None:
        return None
    grey, small = window
    painting = gallery.paint(small)
    known = cv2.erode(painting.known.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    near = cv2.dilate(known.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0
    radius = _DETAIL_MM * px_per_mm(small)
    ours = normalize_contrast(painting.grey.astype(np.float32), known, radius)
    theirs = normalize_contrast(grey.astype(np.float32), near, radius)
    shifts = optical_flow(ours, theirs)
    rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]].astype(np.float32)
    found = cv2.remap(
        theirs, columns + shifts[..., 0], rows + shifts[..., 1], cv2.INTER_LINEAR, borderValue=0.0
    )
    alike = np.where(known, local_correlation(ours, found), 0)
    share = np.maximum(cv2.GaussianBlur(known.astype(np.float32), (0, 0), radius), 1e-3)
    energy = cv2.GaussianBlur(ours * ours, (0, 0), radius) / share
    telling = known & (energy > _LEAST_ENERGY)
    return Alignment(painting, small, shifts, alike, telling)


def improve(
    camera: Camera, alignment: Alignment, sigma_mm: float, focal: FocalBelief
) -> Camera | None:
    """The photo's camera as what looks alike wants it; None where too little does."""
    alike = alignment.alike > _ALIKE
    rows, columns = np.nonzero(alike[::_SPACING_PX, ::_SPACING_PX])
    rows, columns = rows * _SPACING_PX, columns * _SPACING_PX
    if len(rows) < _FEWEST:
        return None
    small = alignment.camera
    found = np.column_stack([columns, rows]) + 0.5 + alignment.shifts[rows, columns]
    scale = small.focal_px / camera.focal_px
    belief = replace(focal, focal_px=focal.focal_px * scale)
    refined = refine_camera(
        small,
        alignment.painting.places[rows, columns],
        found,
        sigma_px=sigma_mm * px_per_mm(small),
        focal=belief,
    )
    if refined is None:
        return None
    return replace(
        camera,
        focal_px=refined.focal_px / scale,
        R_cam_head=refined.R_cam_head,
        t_cam_head=refined.t_cam_head,
    )


def _window(
    photo: UInt8[Array, "h w 3"], camera: Camera, gallery: Gallery, resolution: float
) -> tuple[UInt8[Array, "h w"], Camera] | None:
    """The part of the photo that shows the head, reduced, and its camera."""
    if camera.to_camera(gallery.corners)[:, 2].min() <= 0:
        return None
    pixels = camera.project(gallery.corners)
    margin = _MARGIN_MM * px_per_mm(camera)
    size = [camera.width, camera.height]
    left, top = np.clip(pixels.min(axis=0) - margin, 0, size).astype(int).tolist()
    right, bottom = np.clip(pixels.max(axis=0) + margin, 0, size).astype(int).tolist()
    factor = min(1.0, resolution / px_per_mm(camera))
    if factor * min(right - left, bottom - top) < _SMALLEST_PX:
        return None
    grey = reduced(photo[top:bottom, left:right], factor)
    part = replace(
        camera,
        width=right - left,
        height=bottom - top,
        principal_px=camera.principal - [left, top],
    )
    return grey, resized_to(part, grey.shape)
