"""Places seen by exact cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expressive import NEUTRAL, bump, skin_seen
from marbled import GENERIC, at
from mien.errors import EstimationError
from mien.reconstruction.observations import reproject

CAMERAS = [at(-15, 4), replace(at(25), principal_px=np.array([180.0, 240.0]))]
SEEN = skin_seen(NEUTRAL, CAMERAS, count=100, sigma_mm=0.5)


def px_of(mm: float) -> np.ndarray:
    """(M,) px by which so many mm across a photo are seen at the head's distance."""
    return mm * np.array([item.focal_px / item.t_cam_head[2] for item in CAMERAS])[SEEN.photo]


def test_nothing_is_missed_where_the_head_is_right() -> None:
    errors = reproject(SEEN, SEEN.on(NEUTRAL), CAMERAS)
    np.testing.assert_allclose(errors.residuals, 0, atol=1e-9)
    np.testing.assert_allclose(errors.weights, 1 / px_of(0.5) ** 2)


def test_misses_are_where_cameras_see_less_where_photos_show() -> None:
    shifted = replace(SEEN, image_points=SEEN.image_points - [3, -4])
    errors = reproject(shifted, SEEN.on(NEUTRAL), CAMERAS)
    np.testing.assert_allclose(errors.residuals, np.tile([3, -4], (200, 1)), atol=1e-9)


@pytest.mark.parametrize("sigmas", [0.1, 1.0, 2.385, 20.0])
def test_what_is_far_off_counts_less(sigmas: float) -> None:
    """Cauchy's: half at 2.385 times the error, where the inverse of the variance is the whole."""
    shifted = replace(SEEN, image_points=SEEN.image_points + px_of(0.5 * sigmas)[:, None] * [0, 1])
    errors = reproject(shifted, SEEN.on(NEUTRAL), CAMERAS)
    expected = 1 / (1 + (sigmas / 2.385) ** 2)
    np.testing.assert_allclose(errors.weights * px_of(0.5) ** 2, expected)


def test_values_at_places_are_those_of_their_corners(rng: np.random.Generator) -> None:
    offsets = rng.normal(size=(3, len(NEUTRAL), 3))
    by_hand = sum(SEEN.barycentrics[:, i, None] * offsets[1, SEEN.corners[:, i]] for i in range(3))
    np.testing.assert_allclose(SEEN.on(offsets)[1], by_hand)
    # Linear over each triangle, and so exact for what is linear.
    np.testing.assert_allclose(SEEN.on(2 * NEUTRAL + 1), 2 * SEEN.on(NEUTRAL) + 1)


def test_joined_sightings_are_both() -> None:
    moved = NEUTRAL + bump(
        GENERIC.mesh.vertices[GENERIC.points["chin"]], width_mm=30, along=(1, 1, 1)
    )
    other = skin_seen(moved, CAMERAS, count=20, sigma_mm=0.1)
    both = SEEN.joined(other)
    residuals = [reproject(item, item.on(NEUTRAL), CAMERAS) for item in (SEEN, other, both)]
    for name in ("residuals", "weights"):
        one, two, joined = (getattr(item, name) for item in residuals)
        np.testing.assert_array_equal(joined, np.concatenate([one, two]))
    assert len(both.sigma_mm) == 240


def test_a_place_behind_its_camera_is_an_error() -> None:
    away = SEEN.on(NEUTRAL)
    away[7] += 2 * (CAMERAS[SEEN.photo[7]].center - away[7])
    with pytest.raises(EstimationError, match="behind a camera that sees it"):
        reproject(SEEN, away, CAMERAS)
