"""Other starts where descent ended in a local minimum: blinks or mouths faster than the frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from mien.arrays import Array, Float
from mien.track.face_model import BLINKS, FaceModel, FaceParameters
from mien.track.parameters import Parameters
from mien.track.photometric.linearization import ImagePair, PyramidLevel

_MIN_RMS = 12.0
"""Grey levels of RMS residual in a region above which other starts are tried, ..."""
_MIN_RATIO = 1.2
"""... if it is so many times that of the rest of the face."""
_MAX_REMAINING = 0.9
"""Squared residual of another start over that of the solution: at most this to be taken."""
_ASIDE, _DOWN = 0.4, 0.3
"""Radians of gaze that are tried to either side, and down."""


def better_start(level: PyramidLevel, parameters: Parameters, pair: ImagePair) -> Parameters | None:
    """Parameters that explain a badly explained region clearly better; None if there are none.

    Tried are the photographed expressions, one at a time in the region; in that of the eyes also
    open and shut lids, and gaze to the sides and down.

    Args:
        level: that was solved.
        parameters: of the solution.
        pair: face and frame at the solution.
    """
    sums, counts = _region_sums(level, pair)
    errors = sums / np.maximum(counts, 1.0)
    elsewhere = (sums.sum() - sums) / np.maximum(counts.sum() - counts, 1.0)
    found = _looking_ahead(level, parameters, errors)
    if found is not None:
        return found
    for region in np.flatnonzero(errors > np.maximum(_MIN_RMS**2, _MIN_RATIO**2 * elsewhere)):
        best = errors[region] * _MAX_REMAINING
        for face in _candidates(level.model, (found or parameters).face, int(region)):
            tried = replace(parameters, face=face)
            sums, counts = _region_sums(level, level.image_pair(tried))
            error = sums[region] / max(counts[region], 1.0)
            if error < best:
                best, found = error, tried
    return found


def _looking_ahead(
    level: PyramidLevel, parameters: Parameters, errors: Float[Array, " r"]
) -> Parameters | None:
    """With the gaze straight ahead, if the gaze found explains the picture no better."""
    if np.abs(parameters.face.gaze).max() < _ASIDE / 3:
        return None
    eyes = ["eye" in region for region in level.model.layout.regions]
    ahead = replace(parameters, face=replace(parameters.face, gaze=np.zeros(2)))
    sums, counts = _region_sums(level, level.image_pair(ahead))
    better = (sums / np.maximum(counts, 1.0))[eyes].sum() < errors[eyes].sum()
    return ahead if better else None


def _candidates(model: FaceModel, face: FaceParameters, region: int) -> Iterator[FaceParameters]:
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
    model: FaceModel,
    face: FaceParameters,
    *,
    blink: float = 0.0,
    gaze: tuple[float, float] = (0.0, 0.0),
) -> FaceParameters:
    units = face.units.copy()
    units[[name in BLINKS for name in model.layout.units]] = blink
    return replace(face, units=units, gaze=np.array(gaze))


def _region_sums(
    level: PyramidLevel, pair: ImagePair
) -> tuple[Float[Array, " r"], Float[Array, " r"]]:
    """(R,) sums of squared residuals in each region, and of weights."""
    weights = level.weights * pair.mask
    squares = weights * (pair.drawn - pair.target) ** 2
    regions = np.where(pair.mask > 0, level.model.region_of[pair.ids], -1)
    inside, count = regions >= 0, len(level.model.layout.regions)
    return (
        np.bincount(regions[inside], squares[inside], count),
        np.bincount(regions[inside], weights[inside], count),
    )
