"""Expressions that units make, seen by exact cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from expressive import (
    FACE,
    STEADY,
    features_of,
    known_head,
    making,
    skin_seen,
    vertices_seen,
    weights_of,
)
from marbled import GENERIC, at
from mien.arrays import Array
from mien.camera import Camera
from mien.numeric.rotation import angle_between, rotation_from_vector
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.expression.known_head import feature_observations
from mien.reconstruction.expression.unit_fit import MAX_WEIGHT, UNIT_SD, UnitFit, fit_unit_weights
from mien.reconstruction.observations import SurfaceObservations

KNOWN = known_head()
NOTHING = np.zeros(52)
WEIGHTS = weights_of(mouthSmile=0.7, browInnerUp=0.6, jawOpen=0.3, eyeBlinkLeft=0.9)
TRUE = making(WEIGHTS)
ONE, TWO = [at(5, -3)], [at(-20, 3), at(15)]


def astray(cameras: Sequence[Camera], *, focal: float = 1.0) -> UnitFit:
    """A start some degrees and 5 % of the distance off, the face at rest."""
    rng = np.random.default_rng(3)
    turns = rotation_from_vector(np.radians(2) * rng.normal(size=(len(cameras), 3)))
    return UnitFit(
        tuple(
            replace(
                item,
                R_cam_head=turn @ item.R_cam_head,
                t_cam_head=item.t_cam_head * [1, 1, 1.05] + [5, -5, 0],
                focal_px=focal * item.focal_px,
            )
            for item, turn in zip(cameras, turns, strict=True)
        ),
        NOTHING,
    )


def refit(
    observations: SurfaceObservations,
    cameras: Sequence[Camera],
    *,
    start: UnitFit | None = None,
    expected: Array = NOTHING,
    focal_sd: float = 0.003,
    free: Array = STEADY,
) -> UnitFit:
    focal = np.full(len(cameras), focal_sd)
    return fit_unit_weights(
        observations, start or astray(cameras), expected, focal, KNOWN, free=free
    )


def check_cameras(found: UnitFit, true: Sequence[Camera], *, degrees: float, mm: float) -> None:
    for item, other in zip(found.cameras, true, strict=True):
        assert np.degrees(angle_between(item.R_cam_head, other.R_cam_head)) < degrees
        np.testing.assert_allclose(item.t_cam_head, other.t_cam_head, atol=mm)


@pytest.mark.parametrize("cameras", [ONE, TWO])
def test_skin_that_is_seen_exactly_tells_cameras_and_units(cameras: list[Camera]) -> None:
    """Against it the belief in a face at rest weighs next to nothing."""
    found = refit(skin_seen(TRUE, cameras, count=1500), cameras)
    check_cameras(found, cameras, degrees=0.01, mm=0.1)
    np.testing.assert_allclose(found.weights, WEIGHTS, atol=0.01)
    assert np.linalg.norm(found.vertices(KNOWN) - TRUE, axis=1)[FACE].max() < 0.1


@pytest.mark.parametrize("cameras", [ONE, TWO])
def test_exact_landmarks_tell_most_of_it(cameras: list[Camera]) -> None:
    """They are believed to be 0.8 to 2.5 mm off, so that units are pulled a little to rest."""
    landmarks = feature_observations(features_of(TRUE, cameras), KNOWN)
    found = refit(landmarks, cameras)
    check_cameras(found, cameras, degrees=0.1, mm=0.5)
    np.testing.assert_allclose(found.weights, WEIGHTS, atol=0.1)
    np.testing.assert_allclose(found.vertices(KNOWN)[FACE], TRUE[FACE], atol=1.5)


def test_what_is_expected_and_seen_is_found_exactly() -> None:
    landmarks = feature_observations(features_of(TRUE, ONE), KNOWN)
    found = refit(landmarks, ONE, expected=WEIGHTS)
    check_cameras(found, ONE, degrees=1e-3, mm=1e-2)
    np.testing.assert_allclose(found.weights, WEIGHTS, atol=1e-4)


def test_what_is_not_seen_is_as_expected() -> None:
    """Only brows and eyes are seen: the mouth does what the detector says."""
    upper = FACE[GENERIC.mesh.vertices[FACE, 1] > 10]
    smiling = weights_of(mouthSmile=0.4, browInnerUp=0.8)
    seen = vertices_seen(making(smiling), ONE, upper, sigma_mm=0.2)
    found = refit(seen, ONE, expected=weights_of(mouthSmile=0.4))
    for name in ("mouthSmileLeft", "mouthSmileRight", "jawOpen", "browInnerUp"):
        row = GENERIC.unit_names.index(name)
        assert found.weights[row] == pytest.approx(smiling[row], abs=0.03)


def test_units_that_are_not_free_stay_at_rest() -> None:
    free = STEADY & (WEIGHTS == 0)
    found = refit(skin_seen(TRUE, ONE, count=500), ONE, free=free)
    assert not found.weights[~free].any()
    check_cameras(found, ONE, degrees=3, mm=100)


def test_cameras_alone_when_no_unit_is_free() -> None:
    seen = skin_seen(KNOWN.vertices, ONE, count=500)
    found = refit(seen, ONE, free=np.zeros(52, bool))
    check_cameras(found, ONE, degrees=1e-3, mm=1e-2)
    np.testing.assert_array_equal(found.vertices(KNOWN), KNOWN.vertices)


@pytest.mark.parametrize(("weight", "bound"), [(1.7, MAX_WEIGHT), (-0.5, 0.0)])
def test_weights_stay_in_their_range(weight: float, bound: float) -> None:
    seen = skin_seen(making(weights_of(jawOpen=weight)), ONE, count=800)
    found = refit(seen, ONE)
    assert found.weights.min() >= 0
    assert found.weights.max() <= MAX_WEIGHT
    assert found.weights[GENERIC.unit_names.index("jawOpen")] == pytest.approx(bound, abs=1e-6)


def test_a_lens_that_is_hardly_known_is_found() -> None:
    seen = skin_seen(TRUE, TWO, count=1500, sigma_mm=0.1)
    found = refit(seen, TWO, start=astray(TWO, focal=1.05), focal_sd=0.3)
    for item, true in zip(found.cameras, TWO, strict=True):
        assert item.focal_px == pytest.approx(true.focal_px, rel=0.005)


def test_a_lens_that_is_known_stays() -> None:
    seen = skin_seen(TRUE, ONE, count=500)
    found = refit(seen, ONE, start=astray(ONE, focal=1.05), focal_sd=1e-5)
    assert found.cameras[0].focal_px == pytest.approx(1.05 * ONE[0].focal_px, rel=1e-4)


def test_a_place_that_lies_beside_its_attachment() -> None:
    """A landmark that means another place than the one it is attached to, and is known to."""
    seen = skin_seen(TRUE, ONE, count=800)
    offset = np.random.default_rng(0).normal(size=seen.offset.shape)
    points = seen.on(TRUE) + offset
    found = refit(replace(seen, offset=offset, image_points=ONE[0].project(points)), ONE)
    check_cameras(found, ONE, degrees=0.01, mm=0.1)
    np.testing.assert_allclose(found.weights, WEIGHTS, atol=0.01)


def test_wild_sightings_change_little() -> None:
    seen = skin_seen(TRUE, ONE, count=800)
    image = seen.image_points.copy()
    image[::10] += [60, 25]
    found = refit(replace(seen, image_points=image), ONE)
    check_cameras(found, ONE, degrees=0.1, mm=1.5)
    np.testing.assert_allclose(found.weights, WEIGHTS, atol=0.05)


def cost(
    state: UnitFit, seen: SurfaceObservations, start: UnitFit, expected: Array, focal_sd: float
) -> float:
    """What fit_unit_weights says it minimizes, written out."""
    total = float((((state.weights - expected) / UNIT_SD)[STEADY] ** 2).sum())
    points = seen.on(state.vertices(KNOWN)) + seen.offset
    for k, (item, before) in enumerate(zip(state.cameras, start.cameras, strict=True)):
        mine = seen.photo == k
        off = item.project(points[mine]) - seen.image_points[mine]
        sigma = seen.sigma_mm[mine] * item.focal_px / item.t_cam_head[2]
        total += float(loss_named("cauchy")((off**2).sum(axis=1) / sigma**2)[0].sum())
        total += (np.log(item.focal_px / before.focal_px) / focal_sd) ** 2
    return total


def test_every_nudge_of_the_answer_costs(rng: np.random.Generator) -> None:
    seen = feature_observations(features_of(TRUE, TWO), KNOWN)
    noisy = seen.image_points + rng.normal(size=seen.image_points.shape)
    seen = replace(seen, image_points=noisy)
    start, expected = astray(TWO), weights_of(mouthSmile=0.5)
    best = refit(seen, TWO, start=start, expected=expected, focal_sd=0.1)
    least = cost(best, seen, start, expected, 0.1)
    inside = np.flatnonzero(STEADY & (best.weights > 0.02))
    assert len(inside) > 5
    for row in rng.choice(inside, 5, replace=False):
        for step in (-0.02, 0.02):
            weights = best.weights.copy()
            weights[row] += step
            assert cost(replace(best, weights=weights), seen, start, expected, 0.1) > least
    first, *others = best.cameras
    for _ in range(6):
        turn = rotation_from_vector(2e-3 * rng.normal(size=3))
        nudged = replace(
            first,
            R_cam_head=turn @ first.R_cam_head,
            t_cam_head=first.t_cam_head + 0.5 * rng.normal(size=3),
        )
        state = replace(best, cameras=(nudged, *others))
        assert cost(state, seen, start, expected, 0.1) > least
