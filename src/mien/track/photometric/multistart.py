"""Another start where descent went into the wrong valley: a blink or a mouth faster than frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float
from mien.track.face_model import BLINKS, FaceParameters, TrackedFace
from mien.track.parameters import Guess
from mien.track.photometric.linearization import Pictures, Scene

_SUSPICIOUS = 12.0
"""Grey levels of RMS difference in a region from which another start is looked for, ..."""
_STANDS_OUT = 1.2
"""... if that is so many times the rest of the face's."""
_BETTER = 0.9
"""Of the difference, squared: another start must bring it down to this."""
_ASIDE, _DOWN = 0.4, 0.3
"""Radians: how far eyes look aside, or down, when they do."""


def better_start(scene: Scene, guess: Guess, seen: Pictures) -> Guess | None:
    """A guess that explains a badly explained region clearly better; None: there is none.

    Tried are the photographed expressions, one at a time in the region; in that of the eyes, open
    and shut lids and looks to the sides.
    """
    sums, counts = _region_sums(scene, seen)
    errors = sums / np.maximum(counts, 1.0)
    elsewhere = (sums.sum() - sums) / np.maximum(counts.sum() - counts, 1.0)
    found = _with_calm_eyes(scene, guess, errors)
    if found is not None:
        return found
    for region in np.flatnonzero(errors > np.maximum(_SUSPICIOUS**2, _STANDS_OUT**2 * elsewhere)):
        best = errors[region] * _BETTER
        for face in _candidates(scene.model, (found or guess).face, int(region)):
            tried = replace(guess, face=face)
            sums, counts = _region_sums(scene, scene.pictures(tried))
            error = sums[region] / max(counts[region], 1.0)
            if error < best:
                best, found = error, tried
    return found


def _with_calm_eyes(scene: Scene, guess: Guess, errors: Float[Array, " r"]) -> Guess | None:
    """Straight ahead, where eyes that look aside explain the picture no better."""
    if np.abs(guess.face.gaze).max() < _ASIDE / 3:
        return None
    eyes = ["eye" in region for region in scene.model.layout.regions]
    calm = replace(guess, face=replace(guess.face, gaze=np.zeros(2)))
    sums, counts = _region_sums(scene, scene.pictures(calm))
    better = (sums / np.maximum(counts, 1.0))[eyes].sum() < errors[eyes].sum()
    return calm if better else None


def _candidates(model: TrackedFace, face: FaceParameters, region: int) -> Iterator[FaceParameters]:
    eyes = "eye" in model.layout.regions[region]
    opened = _with_eyes(model, face) if eyes else face
    for weights in np.eye(len(model.layout.expressions)):
        alpha = opened.alpha.copy()
        alpha[region] = model.basis.alpha(weights)
        yield replace(opened, alpha=alpha)
    if eyes:
        yield _with_eyes(model, face, blink=1.0)
        for gaze in ((0.0, 0.0), (-_ASIDE, 0.0), (_ASIDE, 0.0), (0.0, -_DOWN)):
            yield _with_eyes(model, face, gaze=gaze)


def _with_eyes(
    model: TrackedFace,
    face: FaceParameters,
    *,
    blink: float = 0.0,
    gaze: tuple[float, float] = (0.0, 0.0),
) -> FaceParameters:
    units = face.units.copy()
    units[[name in BLINKS for name in model.layout.units]] = blink
    return replace(face, units=units, gaze=np.array(gaze))


def _region_sums(scene: Scene, seen: Pictures) -> tuple[Float[Array, " r"], Float[Array, " r"]]:
    """(R,) sums of squared differences in each region, and how many pixels they are."""
    weights = scene.weights * seen.mask
    squares = weights * (seen.drawn - seen.target) ** 2
    regions = np.where(seen.mask > 0, scene.model.region_of[seen.ids], -1)
    inside, count = regions >= 0, len(scene.model.layout.regions)
    return (
        np.bincount(regions[inside], squares[inside], count),
        np.bincount(regions[inside], weights[inside], count),
    )
