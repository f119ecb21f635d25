"""Eyeballs turned as is known, irises marked where they are then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from expressive import NEUTRAL, exactly_detected, looking, neutral_photo
from marbled import GENERIC, at
from mien.capture.faces.mediapipe_face import LEFT_IRIS, RIGHT_IRIS
from mien.reconstruction.expression.gaze import iris_directions, yaw_pitch_from_directions
from people import person

IRISES = [LEFT_IRIS, RIGHT_IRIS]


def angles(vertices: np.ndarray, *, seen_from: float, turned: tuple[float, float]) -> np.ndarray:
    """(2, 2) degrees that are found of irises on eyes turned so, in a photo from there."""
    item = at(seen_from, 3)
    view = exactly_detected(neutral_photo(), item, looking(vertices, *turned))
    directions = iris_directions(view, item, vertices, GENERIC)
    assert directions is not None
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    return np.degrees(yaw_pitch_from_directions(directions))


@pytest.mark.parametrize("seen_from", [-30.0, 0.0, 15.0])
@pytest.mark.parametrize("turned", [(0.0, 0.0), (20.0, 0.0), (-12.0, 15.0), (5.0, -25.0)])
@pytest.mark.parametrize("who", [NEUTRAL, person(8)], ids=["3", "8"])
def test_a_turn_of_the_eyes_is_found_from_any_side(
    who: np.ndarray, turned: tuple[float, float], seen_from: float
) -> None:
    rest = angles(who, seen_from=0, turned=(0, 0))
    found = angles(who, seen_from=seen_from, turned=turned)
    # The irises do not lie exactly before the centres: a turn moves them on small circles.
    np.testing.assert_allclose(found - rest, np.tile(turned, (2, 1)), atol=0.5)
    if not any(turned):
        np.testing.assert_allclose(found, rest, atol=0.01)


def test_directions_are_those_from_the_centres_to_the_irises() -> None:
    vertices = looking(NEUTRAL, 10, -5)
    view = exactly_detected(neutral_photo(), at(12), vertices)
    directions = iris_directions(view, at(12), NEUTRAL, GENERIC)
    points = GENERIC.landmark_positions(vertices)[IRISES]
    for found, place, name in zip(directions, points, ("left", "right"), strict=True):
        ball = GENERIC.mesh.vertices_of(f"{name}_eyeball")
        true = place - NEUTRAL[ball].mean(axis=0)
        np.testing.assert_allclose(found, true / np.linalg.norm(true), atol=1e-4)


def test_an_iris_off_its_ball_grazes_it() -> None:
    view = exactly_detected(neutral_photo(), at(0), NEUTRAL)
    points = view.landmarks.points.copy()
    points[LEFT_IRIS] += [60, 0]
    astray = replace(view, landmarks=replace(view.landmarks, points=points))
    left, right = iris_directions(astray, at(0), NEUTRAL, GENERIC)
    assert np.linalg.norm(left) == pytest.approx(1)
    np.testing.assert_allclose(left, [1, 0, 0], atol=0.15)
    np.testing.assert_array_equal(right, iris_directions(view, at(0), NEUTRAL, GENERIC)[1])


def test_without_landmarks_nothing_is_known() -> None:
    view = replace(neutral_photo(), landmarks=None)
    assert iris_directions(view, at(0), NEUTRAL, GENERIC) is None


def test_yaw_is_to_the_subjects_left_and_pitch_up(rng: np.random.Generator) -> None:
    yaw, pitch = rng.uniform(-1, 1, size=(2, 20))
    directions = np.column_stack(
        [np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)]
    )
    np.testing.assert_allclose(yaw_pitch_from_directions(directions), np.column_stack([yaw, pitch]))
