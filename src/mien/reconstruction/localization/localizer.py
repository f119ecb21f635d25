"""Cameras of photos in which no face was found, from the other photos of the same person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.reconstruction.localization.alignment import Alignment, align, refine
from mien.reconstruction.localization.camera_refinement import FocalLengthPrior
from mien.reconstruction.localization.initial_cameras import initial_cameras, reference_views
from mien.reconstruction.localization.photo_renderer import (
    PX_PER_MM,
    PhotoRenderer,
    px_per_mm,
    reduced,
    resized_to,
)

_SEARCH_SIDE = 1200
"""Px of the longer side in which features are searched."""
_EXIF_DEVIATION, _SAME_LENS_DEVIATION = 0.05, 0.1
_ROUGH_PX_PER_MM = 1.0
_ROUGH_SIGMAS_MM, _FINE_SIGMA_MM = (3.0, 2.0), 1.0
"""How far matches of the rounds may miss: shape and cameras are off, too."""
_GOOD_FRACTION, _ROUGH_MM = 0.5, 4.0
MIN_MATCHING_FRACTION, MATCHING_MM = 0.45, 1.5
"""Fraction of the head that matches within so many mm. Measured: 0.5 to 0.95 where a camera is
right, up to 0.21 for mirrored photos, for another head in the same skin, for wrong cameras
(docs/method/registration.md)."""
_MIN_AREA_MM2 = 1000.0


def localize_view(
    view: CapturedView,
    others: Sequence[tuple[CapturedView, Camera]],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> Camera | None:
    """The camera of a photo, found by what it shows of a head that other photos show, too.

    Features of the photo are matched with renderings of the head from several sides, made from the
    other photos. The cameras that most matches support are refined by aligning the photo with a
    rendering by that camera, and the best is accepted only if enough of the head matches.

    Args:
        view: the photo.
        others: photos of the same person with the same expression, and their cameras.
        vertices: (V, 3) mm, the head that those cameras belong to, head space.
        generic: the generic head.

    Returns:
        the camera, good to a degree or two; None where there is no clear evidence for any.
    """
    return _Localizer(others, vertices, generic).localize(view) if others else None


def localize_views(
    views: Sequence[CapturedView],
    others: Sequence[tuple[CapturedView, Camera]],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> tuple[Camera | None, ...]:
    """As localize_view for several photos, of which those localized help with the rest."""
    localized, cameras = list(others), dict[int, Camera]()
    while localized:
        localizer = _Localizer(localized, vertices, generic)
        open_views = [k for k in range(len(views)) if k not in cameras]
        found = {
            k: camera for k in open_views if (camera := localizer.localize(views[k])) is not None
        }
        if not found:
            break
        cameras |= found
        localized += [(views[k], camera) for k, camera in found.items()]
    return tuple(cameras.get(k) for k in range(len(views)))


@dataclass(frozen=True)
class _Fit:
    camera: Camera
    alignment: Alignment


class _Localizer:
    """What is the same for every photo to be placed."""

    def __init__(
        self,
        others: Sequence[tuple[CapturedView, Camera]],
        vertices: Float[Array, "v 3"],
        generic: GenericHead,
    ) -> None:
        self.renderer = PhotoRenderer(others, vertices, generic)
        self.references = reference_views(self.renderer)
        cameras = [camera for _, camera in others]
        sides = np.array([max(camera.width, camera.height) for camera in cameras])
        self.relative_focal = float(np.median([c.focal_px for c in cameras] / sides))
        self.relative_scale = float(np.median([px_per_mm(c) for c in cameras] / sides))

    def localize(self, view: CapturedView) -> Camera | None:
        """The camera of the first start that ends well."""
        photo = view.photo
        focal = self._focal_prior(photo)
        rough: _Fit | None = None
        for start in self._starts(photo, focal):
            fit = self._refined(photo, start, focal, _ROUGH_PX_PER_MM, _ROUGH_SIGMAS_MM)
            if fit is None:
                continue
            if rough is None or _rough_fraction(fit) > _rough_fraction(rough):
                rough = fit
            if _rough_fraction(rough) > _GOOD_FRACTION:
                break
        if rough is None:
            return None
        fine = self._refined(photo, rough.camera, focal, PX_PER_MM, (_FINE_SIGMA_MM,))
        return fine.camera if fine is not None and _is_accepted(fine) else None

    def _focal_prior(self, photo: Photo) -> FocalLengthPrior:
        """EXIF where the photo has it; otherwise the lens that took the others."""
        if photo.focal_prior_px is not None:
            return FocalLengthPrior(photo.focal_prior_px, _EXIF_DEVIATION)
        return FocalLengthPrior(self.relative_focal * max(photo.size), _SAME_LENS_DEVIATION)

    def _starts(self, photo: Photo, focal: FocalLengthPrior) -> list[Camera]:
        """In the photo's own pixels."""
        depth = focal.focal_px / (self.relative_scale * max(photo.size))
        template = Camera(*photo.size, focal.focal_px, np.eye(3), np.array([0, 0, depth]))
        grey = reduced(photo.pixels, _SEARCH_SIDE / max(photo.size))
        starts = initial_cameras(
            grey, resized_to(template, grey.shape), self.references, self.renderer.center
        )
        return [
            replace(template, R_cam_head=start.R_cam_head, t_cam_head=start.t_cam_head)
            for start in starts
        ]

    def _refined(
        self,
        photo: Photo,
        camera: Camera,
        focal: FocalLengthPrior,
        resolution: float,
        sigmas_mm: tuple[float, ...],
    ) -> _Fit | None:
        """As many rounds as there are sigmas; None where the photo stops resembling the head."""
        alignment = align(photo.pixels, camera, self.renderer, resolution)
        for sigma_mm in sigmas_mm:
            refined = None if alignment is None else refine(camera, alignment, sigma_mm, focal)
            if refined is None:
                return None
            camera = refined
            alignment = align(photo.pixels, camera, self.renderer, resolution)
        return None if alignment is None else _Fit(camera, alignment)


def _rough_fraction(fit: _Fit) -> float:
    return fit.alignment.matching_fraction(_ROUGH_MM)


def _is_accepted(fit: _Fit) -> bool:
    """Whether enough of the head is compared, and enough of that matches."""
    enough = fit.alignment.textured_mm2 > _MIN_AREA_MM2
    return enough and fit.alignment.matching_fraction(MATCHING_MM) > MIN_MATCHING_FRACTION
