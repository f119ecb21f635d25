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
from mien.reconstruction.localization.alignment import Alignment, align, improve
from mien.reconstruction.localization.camera_refinement import FocalBelief
from mien.reconstruction.localization.candidates import find_looks, find_starts
from mien.reconstruction.localization.gallery import (
    PX_PER_MM,
    Gallery,
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
_PROMISING, _PROMISING_MM = 0.5, 4.0
LEAST_AGREEMENT, AGREEMENT_MM = 0.45, 1.5
"""Share of the head that looks alike within so many mm. Measured: 0.5 to 0.95 where a camera is
right, up to 0.21 for mirrored photos, for another head in the same skin, for wrong cameras
(docs/method/registration.md)."""
_LEAST_AREA_MM2 = 1000.0


def place_view(
    view: CapturedView,
    others: Sequence[tuple[CapturedView, Camera]],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> Camera | None:
    """The camera of a photo, found by what it shows of a head that other photos show, too.

    Features of the photo are matched with how the head looks from several sides, painted with the
    colours of the other photos. The looks that match best are refined by laying the photo over
    the head, painted as the camera sees it, and the best is accepted only if both look alike.

    Args:
        others: photos of the same person with the same expression, and their cameras.
        vertices: (V, 3) mm, the head that those cameras belong to, head space.

    Returns:
        the camera, good to a degree or two; None where there is no clear evidence for any.
    """
    return _Placer(others, vertices, generic).place(view) if others else None


def place_views(
    views: Sequence[CapturedView],
    others: Sequence[tuple[CapturedView, Camera]],
    vertices: Float[Array, "v 3"],
    generic: GenericHead,
) -> tuple[Camera | None, ...]:
    """As place_view for several photos, of which those placed help to place the rest."""
    known, cameras = list(others), dict[int, Camera]()
    while known:
        placer = _Placer(known, vertices, generic)
        open_views = [k for k in range(len(views)) if k not in cameras]
        found = {k: camera for k in open_views if (camera := placer.place(views[k])) is not None}
        if not found:
            break
        cameras |= found
        known += [(views[k], camera) for k, camera in found.items()]
    return tuple(cameras.get(k) for k in range(len(views)))


@dataclass(frozen=True)
class _Fit:
    camera: Camera
    alignment: Alignment


class _Placer:
    """What is the same for every photo to be placed."""

    def __init__(
        self,
        others: Sequence[tuple[CapturedView, Camera]],
        vertices: Float[Array, "v 3"],
        generic: GenericHead,
    ) -> None:
        self.gallery = Gallery(others, vertices, generic)
        self.looks = find_looks(self.gallery)
        cameras = [camera for _, camera in others]
        sides = np.array([max(camera.width, camera.height) for camera in cameras])
        self.relative_focal = float(np.median([c.focal_px for c in cameras] / sides))
        self.relative_scale = float(np.median([px_per_mm(c) for c in cameras] / sides))

    def place(self, view: CapturedView) -> Camera | None:
        """The camera of the first start that ends well."""
        photo = view.photo
        focal = self._focal_belief(photo)
        rough: _Fit | None = None
        for start in self._starts(photo, focal):
            fit = self._refined(photo, start, focal, _ROUGH_PX_PER_MM, _ROUGH_SIGMAS_MM)
            if fit is None:
                continue
            if rough is None or _promise(fit) > _promise(rough):
                rough = fit
            if _promise(rough) > _PROMISING:
                break
        if rough is None:
            return None
        fine = self._refined(photo, rough.camera, focal, PX_PER_MM, (_FINE_SIGMA_MM,))
        return fine.camera if fine is not None and _is_evident(fine) else None

    def _focal_belief(self, photo: Photo) -> FocalBelief:
        """EXIF where the photo has it; otherwise the lens that took the others."""
        if photo.focal_prior_px is not None:
            return FocalBelief(photo.focal_prior_px, _EXIF_DEVIATION)
        return FocalBelief(self.relative_focal * max(photo.size), _SAME_LENS_DEVIATION)

    def _starts(self, photo: Photo, focal: FocalBelief) -> list[Camera]:
        """In the photo's own pixels."""
        depth = focal.focal_px / (self.relative_scale * max(photo.size))
        template = Camera(*photo.size, focal.focal_px, np.eye(3), np.array([0, 0, depth]))
        grey = reduced(photo.pixels, _SEARCH_SIDE / max(photo.size))
        starts = find_starts(
            grey, resized_to(template, grey.shape), self.looks, self.gallery.center
        )
        return [
            replace(template, R_cam_head=start.R_cam_head, t_cam_head=start.t_cam_head)
            for start in starts
        ]

    def _refined(
        self,
        photo: Photo,
        camera: Camera,
        focal: FocalBelief,
        resolution: float,
        sigmas_mm: tuple[float, ...],
    ) -> _Fit | None:
        """As many rounds as there are sigmas; None where the photo stops resembling the head."""
        alignment = align(photo.pixels, camera, self.gallery, resolution)
        for sigma_mm in sigmas_mm:
            improved = None if alignment is None else improve(camera, alignment, sigma_mm, focal)
            if improved is None:
                return None
            camera = improved
            alignment = align(photo.pixels, camera, self.gallery, resolution)
        return None if alignment is None else _Fit(camera, alignment)


def _promise(fit: _Fit) -> float:
    return fit.alignment.agreement(_PROMISING_MM)


def _is_evident(fit: _Fit) -> bool:
    """Enough of the head is compared, and enough of that looks alike in nearly the right place."""
    enough = fit.alignment.telling_mm2 > _LEAST_AREA_MM2
    return enough and fit.alignment.agreement(AGREEMENT_MM) > LEAST_AGREEMENT
