from __future__ import annotations

import numpy as np

from mien.assets.generic import load_generic_head
from mien.reconstruction.features import Features, gather_features
from mien.reconstruction.shape.from_features import (
    MODEL_SIGMA_MM,
    estimate_coefficients,
    shape_from_features,
)
from mien.reconstruction.shape.model import shape_model
from people import camera, cameras, person, photographed

GENERIC = load_generic_head()
MODEL = shape_model([], GENERIC)
HEAD = GENERIC.mesh.vertices
FIVE = cameras()


def features_of(vertices: np.ndarray, seen_from: list, **marks: object) -> Features:
    views = [
        photographed(vertices, item, name=f"{k}.png", **marks) for k, item in enumerate(seen_from)
    ]
    return gather_features(views, GENERIC)


def test_the_generic_head_stays_itself() -> None:
    features = features_of(HEAD, FIVE)
    shape = shape_from_features(features, features.on(HEAD), FIVE, GENERIC, MODEL)
    np.testing.assert_allclose(shape, HEAD, atol=1e-6)


def test_identity_is_the_most_probable_one() -> None:
    truth = person(7)
    features = features_of(truth, FIVE)
    points = features.on(truth)
    best = estimate_coefficients(features, points, MODEL)
    components = features.on(GENERIC.identity.components)

    def cost(coefficients: np.ndarray) -> float:
        off = features.on(HEAD) + np.tensordot(coefficients, components, 1) - points
        return float((off**2).sum() / MODEL_SIGMA_MM**2 + (coefficients**2).sum())

    for k in range(len(best)):
        nudge = np.zeros(len(best))
        nudge[k] = 1e-3
        assert cost(best) < min(cost(best + nudge), cost(best - nudge))


def test_a_person_is_found_from_points_known_exactly() -> None:
    """To a tenth of what the generic head is off; marks have a deviation and are not met."""
    truth = person(8)
    features = features_of(truth, FIVE)
    shape = shape_from_features(features, features.on(truth), FIVE, GENERIC, MODEL)
    face = np.linalg.norm(HEAD[:, None] - features.on(HEAD), axis=2).min(axis=1) < 12
    off, generic_off = (np.linalg.norm(head - truth, axis=1)[face] for head in (shape, HEAD))
    assert np.median(off) < 0.1 * np.median(generic_off)
    assert np.linalg.norm(features.on(shape) - features.on(truth), axis=1).mean() < 0.5


def test_a_feature_seen_once_moves_towards_its_ray() -> None:
    truth = person(9)
    once, twice = "left_ear.2", ["nose_tip", "chin", "left_eye_outer", "right_eye_outer"]
    twice += ["left_mouth_corner", "right_mouth_corner", "left_ear_lobe", "hairline.4"]
    seen_from = [camera(50), camera(-10)]
    views = [
        photographed(truth, seen_from[0], points=[*twice, once]),
        photographed(truth, seen_from[1], points=twice),
    ]
    features = gather_features(views, GENERIC)
    column = features.names.index(once)
    points = features.on(truth)
    points[column] = features.on(HEAD)[column]
    goal = features.image_points[0, column]
    off = []
    for rounds in (0, 2, 6):
        shape = shape_from_features(features, points, seen_from, GENERIC, MODEL, rounds=rounds)
        assert np.isfinite(shape).all()
        off.append(np.linalg.norm(seen_from[0].project(features.on(shape))[column] - goal))
    assert off[0] > off[1] > off[2]
