"""The cost of what points might have been."""

from __future__ import annotations

import numpy as np
import pytest

from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.marginal_likelihood import point_evidence


@pytest.fixture
def given(make_scene, rng):
    scene = make_scene(0)
    return {
        "R": np.stack([camera.R_cam_head for camera in scene.cameras]),
        "t": np.stack([camera.t_cam_head for camera in scene.cameras]),
        "focal": np.array([camera.focal_px for camera in scene.cameras]),
        "precision": np.isfinite(scene.image_points[..., 0]) * rng.uniform(0.3, 1, (5, 60)),
        "points": scene.generic,
        "sigma": rng.uniform(0.5, 2, 60),
    }


def moved(given, photo, unknown, size):
    R, t, focal = given["R"].copy(), given["t"].copy(), given["focal"].copy()
    if unknown < 3:
        R[photo] = rotation_from_vector(size * np.eye(3)[unknown]) @ R[photo]
    elif unknown < 5:
        t[photo, unknown - 3] += size
    elif unknown == 5:
        t[photo, 2] *= np.exp(size)
    else:
        focal[photo] *= np.exp(size)
    return {**given, "R": R, "t": t, "focal": focal}


def test_gradient_against_central_differences(given):
    gradient = point_evidence(**given)[1]
    h = 1e-5
    for photo in (0, 3):
        for unknown in range(7):
            ahead, behind = (point_evidence(**moved(given, photo, unknown, s))[0] for s in (h, -h))
            numeric = (ahead - behind) / (2 * h)
            assert gradient[photo, unknown] == pytest.approx(numeric, rel=1e-5, abs=1e-5)


def test_is_the_determinant_of_the_images_covariance(given, make_scene):
    """One point: det(1 + sigma^2 J J^T) over all its image coordinates."""
    camera, h = make_scene(0).cameras[0], 1e-4
    place = given["points"][4]
    jacobian = np.stack(
        [
            (camera.project((place + h * e)[None]) - camera.project((place - h * e)[None]))[0]
            for e in np.eye(3)
        ],
        axis=1,
    ) / (2 * h)
    expected = 0.5 * np.log(np.linalg.det(np.eye(2) + 4 * jacobian @ jacobian.T))
    one = {name: given[name][:1] for name in ("R", "t", "focal")}
    value = point_evidence(
        **one, precision=np.ones((1, 1)), points=place[None], sigma=np.array([2.0])
    )
    assert value[0] == pytest.approx(expected, rel=1e-6)


def test_points_without_a_prior_do_not_count(given):
    given["sigma"][10:] = np.inf
    whole = point_evidence(**given)
    few = {**given, **{n: given[n][..., :10] for n in ("precision", "sigma")}}
    few["points"] = given["points"][:10]
    assert whole[0] == point_evidence(**few)[0]
    np.testing.assert_array_equal(whole[1], point_evidence(**few)[1])


def test_nothing_seen_costs_nothing(given):
    given["precision"][:] = 0
    value, gradient = point_evidence(**given)
    assert value == 0
    np.testing.assert_array_equal(gradient, 0)
