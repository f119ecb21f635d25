"""Marbled skin found again in a photo of an expression that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expressive import FACE, NEUTRAL, known_head, making, neutral_photo, weights_of
from marbled import GENERIC, Person, at, clutter
from mien.arrays import Array
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.expression.skin_tracking import MATCHED_SIGMA_MM, _nearest, track_skin
from mien.reconstruction.observations import SurfaceObservations

KNOWN = known_head(-25.0, 0.0, 25.0)
CAMERA = at(6, -3)
TRUE = making(weights_of(mouthSmile=0.7, browInnerUp=0.6, jawOpen=0.3))
VIEW = Person(TRUE, 1).seen_by(CAMERA)


def followed(
    start: Array, *, mm_per_px: float = 0.8, known: KnownHead = KNOWN
) -> SurfaceObservations:
    found = track_skin(VIEW, CAMERA, start, known, photo=3, mm_per_px=mm_per_px)
    assert found is not None
    return found


def off_px(found: SurfaceObservations) -> Array:
    return np.linalg.norm(CAMERA.project(found.on(TRUE)) - found.image_points, axis=1)


@pytest.mark.parametrize(("mm_per_px", "most"), [(0.8, 0.1), (1.6, 0.2)])
def test_places_are_found_where_they_are_seen(mm_per_px: float, most: float) -> None:
    found = followed(TRUE, mm_per_px=mm_per_px)
    assert len(found.photo) > 800
    assert np.median(off_px(found)) < most / 2
    assert np.percentile(off_px(found), 95) < most
    bias = (CAMERA.project(found.on(TRUE)) - found.image_points).mean(axis=0)
    np.testing.assert_allclose(bias, 0, atol=0.03)


def test_an_expression_that_is_not_known_yet_is_found() -> None:
    """Skin has moved by up to 12 px."""
    found = followed(NEUTRAL)
    moved = np.linalg.norm(
        CAMERA.project(found.on(NEUTRAL)) - CAMERA.project(found.on(TRUE)), axis=1
    )
    far = moved > 2
    assert far.sum() > 100
    assert np.median(off_px(found)[far]) < 0.15 * np.median(moved[far])
    assert np.percentile(off_px(found), 90) < 1.2


def test_only_skin_that_goes_with_the_head() -> None:
    found = followed(TRUE)
    for name in ("neck", "scalp", "left_ear", "right_ear"):
        assert GENERIC.regions[name][found.corners].max() < 0.5
    assert GENERIC.regions["eye_socket"][found.corners].max() < 1
    assert np.isin(found.corners, FACE).mean() > 0.8


def test_sightings_as_later_steps_want_them() -> None:
    found = followed(TRUE)
    assert (found.photo == 3).all()
    np.testing.assert_array_equal(found.offset, 0)
    np.testing.assert_allclose(found.barycentrics.sum(axis=1), 1, atol=1e-5)
    assert (found.sigma_mm >= MATCHED_SIGMA_MM).all()
    # Evenly spread: none twice, none nearer to another than the grid says.
    points = found.on(NEUTRAL)
    assert len(np.unique(points, axis=0)) == len(points)


def test_the_nearest_neutral_photo_with_a_face_is_looked_at() -> None:
    assert [_nearest(at(yaw), KNOWN) for yaw in (-40, -5, 30)] == [0, 1, 2]
    faceless = replace(KNOWN.views[1], landmarks=None, annotations=None)
    known = replace(KNOWN, views=[KNOWN.views[0], faceless, KNOWN.views[2]])
    assert _nearest(at(2), known) == 2


@pytest.mark.parametrize("shown", ["grey", "somewhere else"])
def test_where_nothing_looks_alike_nothing_is_found(shown: str) -> None:
    pixels = VIEW.photo.pixels
    if shown == "grey":
        view = replace(VIEW, photo=replace(VIEW.photo, pixels=np.full_like(pixels, 120)))
        seen_from = CAMERA
    else:
        noise = np.clip(clutter(*pixels.shape[:2], 8), 0, 255).astype(np.uint8)
        view = replace(VIEW, photo=replace(VIEW.photo, pixels=np.stack([noise] * 3, axis=2)))
        seen_from = replace(CAMERA, t_cam_head=CAMERA.t_cam_head + np.array([3000.0, 0, 0]))
    assert track_skin(view, seen_from, TRUE, KNOWN, photo=0, mm_per_px=1.6) is None


def test_the_same_photo_is_found_in_itself() -> None:
    found = track_skin(neutral_photo(), at(0), NEUTRAL, known_head(), photo=0, mm_per_px=0.8)
    assert found is not None
    off = np.linalg.norm(at(0).project(found.on(NEUTRAL)) - found.image_points, axis=1)
    assert np.percentile(off, 95) < 0.15
