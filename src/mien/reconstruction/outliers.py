"""Which marks and which photos do not fit the head, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.reconstruction.features import Features
from mien.reconstruction.result import Mark, PhotoFit

OUTLIER_SIGMAS = 5.0
"""A mark this many times its expected error off the model is distrusted."""
OUTLIER_PHOTO_SIGMAS, OUTLIER_PHOTO_RATIO = 4.0, 3.0
"""A photo is left out when its marks lie, in the median, this many expected errors off, and this
many times farther than the other photos'."""
MAX_OUTLIER_FRACTION = 0.35
"""When more of a photo's hand marks are distrusted, their names may be wrong."""
INCONSISTENT_SIGMAS = 12.0
"""When every photo's marks lie this far off, one of them spoils the head for all."""
MIN_PARALLAX_DEG = 8.0


def classify_marks(
    features: Features, k: int, residuals: Float[Array, "n 2"], sigma_px: Float[Array, " n"]
) -> tuple[Mark, ...]:
    """Every mark of photo k with its residual; far off its expected error it gets a rejection."""
    marks = []
    for n in np.flatnonzero(features.observed[k]):
        off = float(np.hypot(*residuals[n])) / sigma_px[n]
        rejection = f"{off:.0f} times its expected error off" if off > OUTLIER_SIGMAS else ""
        by_hand = bool(features.by_hand[k, n])
        place = features.image_points[k, n]
        marks.append(Mark(features.names[n], place, residuals[n], by_hand, rejection))
    return tuple(marks)


def median_normalized_residuals(
    residuals: Float[Array, "k n 2"], sigma_px: Float[Array, "k n"]
) -> Float[Array, " k"]:
    """(K,) how many expected errors each photo's marks lie off, in the median."""
    off = np.linalg.norm(residuals, axis=2) / sigma_px
    return np.array([np.median(row[np.isfinite(row)]) for row in off])


def find_outlier_photo(typical: Float[Array, " k"]) -> tuple[int, str] | None:
    """The photo that fits worst and why, if it fits so badly that it shows something else."""
    if len(typical) < 2:
        return None
    worst = int(typical.argmax())
    others = float(np.median(np.delete(typical, worst)))
    if typical[worst] < max(OUTLIER_PHOTO_SIGMAS, OUTLIER_PHOTO_RATIO * others):
        return None
    return worst, (
        f"its marks lie {typical[worst]:.1f} times their expected error off the head that the "
        f"other photos show ({others:.1f} times there)"
    )


def depth_notes(cameras: Sequence[Camera]) -> tuple[str, ...]:
    """Notes for the user where the viewpoints do not determine depth."""
    if len(cameras) == 1:
        return ("one photo: depth comes from the prior of faces, not from this person",)
    spread = largest_view_angle(cameras)
    if spread < MIN_PARALLAX_DEG:
        return (
            f"all photos come from within {spread:.0f} degrees: depth comes from the prior of "
            f"faces, not from this person ({MIN_PARALLAX_DEG:.0f} degrees or more would show it)",
        )
    return ()


def largest_view_angle(cameras: Sequence[Camera]) -> float:
    """Degrees between the two directions farthest apart from which cameras look at the head."""
    axes = np.stack([camera.center / np.linalg.norm(camera.center) for camera in cameras])
    return float(np.degrees(np.arccos(np.clip(axes @ axes.T, -1, 1)).max()))


def name_notes(photos: Mapping[str, PhotoFit]) -> tuple[str, ...]:
    """Photos whose hand marks fit so badly that their names may be wrong."""
    notes = []
    for photo, fit in photos.items():
        by_hand = [mark for mark in fit.marks if mark.by_hand]
        distrusted = [mark for mark in by_hand if mark.rejection]
        if len(distrusted) > MAX_OUTLIER_FRACTION * len(by_hand):
            notes.append(
                f"{photo}: {len(distrusted)} of its {len(by_hand)} hand-made marks are distrusted: "
                "are their names right, and left and right the subject's?"
            )
    return tuple(notes)
