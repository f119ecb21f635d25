"""A photo aligned with a rendering of a known head, and how well they match."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, UInt8
from mien.camera import Camera
from mien.numeric.images.optical_flow import local_correlation, normalize_contrast, optical_flow
from mien.reconstruction.localization.camera_refinement import FocalLengthPrior, refine_camera
from mien.reconstruction.localization.photo_renderer import (
    PhotoRenderer,
    PhotoRendering,
    px_per_mm,
    reduced,
    resized_to,
)

_MARGIN_MM = 20.0
_DETAIL_MM = 2.0
"""Contrast is compared over about this distance: wider shading differs from photo to photo."""
_MIN_CORRELATION = 0.5
_MIN_ENERGY = 0.25
"""Of normalized contrast, of a place that shows no more than noise: plain skin is not used."""
_SPACING_PX = 5
_MIN_MATCHES = 30
_MIN_SIDE_PX = 40


@dataclass(frozen=True)
class Alignment:
    """A rendering matched with the photo.

    Attributes:
        rendering: as the camera sees it.
        camera: of the rendering, which shows a part of the photo.
        shifts: (H, W, 2) px from the rendering to the photo.
        correlation: (H, W) -1 to 1, of a pixel's surroundings with those that it was matched
            with; 0 where the rendering is not visible.
        textured: (H, W) where the rendering is visible and has some contrast.
    """

    rendering: PhotoRendering
    camera: Camera
    shifts: Float[Array, "h w 2"]
    correlation: Float[Array, "h w"]
    textured: Bool[Array, "h w"]

    @property
    def textured_mm2(self) -> float:
        """Area of the textured part in the picture."""
        return float(np.count_nonzero(self.textured)) / px_per_mm(self.camera) ** 2

    def matching_fraction(self, within_mm: float) -> float:
        """Fraction of the textured pixels that correlate and are shifted by less than this."""
        if not self.textured.any():
            return 0.0
        off_mm = np.hypot(self.shifts[..., 0], self.shifts[..., 1]) / px_per_mm(self.camera)
        agrees = (self.correlation > _MIN_CORRELATION) & (off_mm < within_mm)
        return float(agrees[self.textured].mean())


def align(
    photo: UInt8[Array, "h w 3"], camera: Camera, renderer: PhotoRenderer, resolution: float
) -> Alignment | None:
    """The photo matched with the head as the camera sees it; None where it hardly does.

    Args:
        photo: pixels.
        camera: of the photo, to within some 20 degrees.
        renderer: of the head.
        resolution: px of the rendering per mm.
    """
    import cv2

    window = _window(photo, camera, renderer, resolution)
    if window is None:
        return None
    grey, small = window
    rendering = renderer.render(small)
    visible = cv2.erode(rendering.visible.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    near = cv2.dilate(visible.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0
    radius = _DETAIL_MM * px_per_mm(small)
    ours = normalize_contrast(rendering.grey.astype(np.float32), visible, radius)
    theirs = normalize_contrast(grey.astype(np.float32), near, radius)
    shifts = optical_flow(ours, theirs)
    rows, columns = np.mgrid[: grey.shape[0], : grey.shape[1]].astype(np.float32)
    found = cv2.remap(
        theirs, columns + shifts[..., 0], rows + shifts[..., 1], cv2.INTER_LINEAR, borderValue=0.0
    )
    correlation = np.where(visible, local_correlation(ours, found), 0)
    share = np.maximum(cv2.GaussianBlur(visible.astype(np.float32), (0, 0), radius), 1e-3)
    energy = cv2.GaussianBlur(ours * ours, (0, 0), radius) / share
    textured = visible & (energy > _MIN_ENERGY)
    return Alignment(rendering, small, shifts, correlation, textured)


def refine(
    camera: Camera, alignment: Alignment, sigma_mm: float, focal: FocalLengthPrior
) -> Camera | None:
    """The photo's camera fitted to the matches that correlate; None where these are too few."""
    correlation = alignment.correlation > _MIN_CORRELATION
    rows, columns = np.nonzero(correlation[::_SPACING_PX, ::_SPACING_PX])
    rows, columns = rows * _SPACING_PX, columns * _SPACING_PX
    if len(rows) < _MIN_MATCHES:
        return None
    small = alignment.camera
    found = np.column_stack([columns, rows]) + 0.5 + alignment.shifts[rows, columns]
    scale = small.focal_px / camera.focal_px
    focal_prior = replace(focal, focal_px=focal.focal_px * scale)
    refined = refine_camera(
        small,
        alignment.rendering.points[rows, columns],
        found,
        sigma_px=sigma_mm * px_per_mm(small),
        focal=focal_prior,
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
    photo: UInt8[Array, "h w 3"], camera: Camera, renderer: PhotoRenderer, resolution: float
) -> tuple[UInt8[Array, "h w"], Camera] | None:
    """The part of the photo that shows the head, reduced, and its camera."""
    if camera.to_camera(renderer.corners)[:, 2].min() <= 0:
        return None
    pixels = camera.project(renderer.corners)
    margin = _MARGIN_MM * px_per_mm(camera)
    size = [camera.width, camera.height]
    left, top = np.clip(pixels.min(axis=0) - margin, 0, size).astype(int).tolist()
    right, bottom = np.clip(pixels.max(axis=0) + margin, 0, size).astype(int).tolist()
    factor = min(1.0, resolution / px_per_mm(camera))
    if factor * min(right - left, bottom - top) < _MIN_SIDE_PX:
        return None
    grey = reduced(photo[top:bottom, left:right], factor)
    part = replace(
        camera,
        width=right - left,
        height=bottom - top,
        principal_px=camera.principal - [left, top],
    )
    return grey, resized_to(part, grey.shape)
