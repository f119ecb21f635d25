"""Derivatives against central differences; the projection against Camera's."""

from __future__ import annotations

import numpy as np
import pytest

from mien.arrays import Array
from mien.errors import EstimationError
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.projection import (
    CAMERA_SIZE,
    PinholeArrays,
    Projection,
    project_points,
)
from observed import observed

SCENE = observed(6, (-25, 10))
PHOTO, PLACE = SCENE.observations.photo, SCENE.observations.point
CAMERAS = PinholeArrays.of(SCENE.cameras)
STEP = 1e-6


def seen(pinholes: PinholeArrays = CAMERAS, places: Array = SCENE.points) -> Projection:
    return project_points(pinholes, PHOTO, places[PLACE])


def moved(step: Array) -> PinholeArrays:
    """All cameras, a step of their unknowns further."""
    return PinholeArrays(
        rotation_from_vector(np.tile(step[:3], (len(CAMERAS.R), 1))) @ CAMERAS.R,
        np.column_stack([CAMERAS.t[:, :2] + step[3:5], CAMERAS.t[:, 2] * np.exp(step[5])]),
        CAMERAS.focal_px * np.exp(step[6]),
    )


def test_image_points_are_the_cameras() -> None:
    expected = np.concatenate(
        [item.project(SCENE.points) - item.principal for item in SCENE.cameras]
    )
    np.testing.assert_allclose(seen().image_points, expected, atol=1e-9)


@pytest.mark.parametrize("unknown", range(CAMERA_SIZE))
def test_derivatives_by_the_camera(unknown: int) -> None:
    step = STEP * np.eye(CAMERA_SIZE)[unknown]
    ahead, behind = (seen(moved(sign * step)).image_points for sign in (1, -1))
    numeric = (ahead - behind) / (2 * STEP)
    np.testing.assert_allclose(
        seen().camera_jacobian()[..., unknown], numeric, rtol=1e-5, atol=1e-3
    )


@pytest.mark.parametrize("axis", range(3))
def test_derivatives_by_the_place(axis: int) -> None:
    step = 1e-4 * np.eye(3)[axis]
    ahead, behind = (seen(places=SCENE.points + sign * step).image_points for sign in (1, -1))
    np.testing.assert_allclose(seen().point_jacobian[..., axis], (ahead - behind) / 2e-4, atol=1e-6)


def test_a_place_behind_its_camera() -> None:
    behind = SCENE.points.copy()
    behind[7] = 2 * SCENE.cameras[0].center
    with pytest.raises(EstimationError, match="behind a camera"):
        seen(places=behind)
