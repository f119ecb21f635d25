from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expressive import NEUTRAL, exactly_detected, neutral_photo
from marbled import GENERIC, Person, at, clutter, photographed
from mien.capture.annotations import Annotations
from mien.capture.images.photos import Photo
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.numeric.rotation import angle_between
from mien.reconstruction import registration
from mien.reconstruction.dense.quality import REGIONS, RegistrationQuality
from mien.reconstruction.dense.register import Registration
from mien.reconstruction.features import EDGE_SIGMA_MM, gather_features
from mien.reconstruction.landmark_fit import Solution, residuals_of
from mien.reconstruction.registration import (
    INCONSISTENT_REGISTRATION,
    MAX_EDGE_RESIDUAL,
    NOT_LOCALIZED,
    NOTHING_SHARED,
    register_solution,
)
from people import person

YAWS = (-30.0, 0.0, 30.0)


@pytest.fixture(scope="module")
def start() -> Solution:
    """Three photos of somebody with their true cameras, the generic head for a shape."""
    return solution_of(photographed(Person(person(3), 1), YAWS))


def solution_of(photos: list) -> Solution:
    cameras = tuple(camera for _, camera in photos)
    places = person(3)[list(GENERIC.points.values())]
    views = tuple(
        replace(
            view,
            annotations=Annotations(dict(zip(GENERIC.points, camera.project(places), strict=True))),
        )
        for view, camera in photos
    )
    features = gather_features(views, GENERIC)
    vertices = GENERIC.mesh.vertices
    residuals = residuals_of(features, cameras, vertices)
    return Solution(views, features, cameras, vertices, residuals, np.ones(len(vertices)), {})


def faceless(pixels: np.ndarray, name: str) -> CapturedView:
    grey = np.clip(pixels, 0, 255).astype(np.uint8)
    return CapturedView(Photo(name, Path(name), np.repeat(grey[..., None], 3, axis=2)), None, None)


def test_a_profile_is_placed_and_a_landscape_is_not(start: Solution) -> None:
    who = Person(person(3), 1)
    profile = who.seen_by(at(55), name="profile.png")
    landscape = faceless(clutter(448, 384, 9), "landscape.png")
    found = register_solution(start, [profile, landscape], GENERIC)
    assert [view.photo.name for view in found.views] == ["0.png", "1.png", "2.png", "profile.png"]
    assert found.problems == {"landscape.png": NOT_LOCALIZED}
    turn = found.cameras[3].R_cam_head @ found.cameras[1].R_cam_head.T
    true = at(55).R_cam_head @ start.cameras[1].R_cam_head.T
    assert np.degrees(angle_between(turn, true)) < 0.5
    assert found.residuals.shape[0] == 4
    assert all(count > 100 for count, _ in found.matches)


def test_photos_that_share_nothing_keep_what_landmarks_say(start: Solution) -> None:
    grey = [
        replace(view, photo=replace(view.photo, pixels=np.full_like(view.photo.pixels, 127)))
        for view in start.views
    ]
    blank = replace(start, views=tuple(grey), features=gather_features(grey, GENERIC))
    found = register_solution(blank, [], GENERIC)
    assert found.notes == (NOTHING_SHARED,)
    assert found.cameras == start.cameras
    np.testing.assert_array_equal(found.vertices, start.vertices)


def test_a_failure_is_told_and_loses_nothing(
    start: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*args: object, **options: object) -> None:
        raise EstimationError("not determined")

    monkeypatch.setattr(registration, "register_views", fails)
    found = register_solution(start, [], GENERIC)
    (note,) = found.notes
    assert "could not be registered with each other (not determined)" in note
    assert found.cameras == start.cameras


def registered_beside(start: Solution, mm: float) -> Registration:
    """The true head with true cameras, all of it so much to its left."""
    nothing = np.zeros(len(start.views))
    quality = RegistrationQuality(
        shared=np.full(len(nothing), 1000),
        outlier_fraction=np.full((len(nothing), len(REGIONS)), np.nan),
        turn_sd=nothing,
        rms_px=nothing,
    )
    vertices = start.vertices + np.array([mm, 0, 0])
    doubts = np.zeros(len(nothing), bool)
    return Registration(start.cameras, vertices, np.full(len(vertices), 0.3), quality, doubts)


@pytest.mark.parametrize("share", [0.0, 0.8, 1.02])
def test_a_head_that_the_landmarks_contradict_is_refused(
    monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    """So many of what landmarks on edges may be off: photos without parallax follow their noise."""
    cameras = [at(yaw) for yaw in (-2.0, 0.0, 2.0)]
    views = tuple(exactly_detected(neutral_photo(), item, NEUTRAL) for item in cameras)
    features = gather_features(views, GENERIC)
    residuals = residuals_of(features, cameras, NEUTRAL)
    start = Solution(views, features, tuple(cameras), NEUTRAL, residuals, np.ones(len(NEUTRAL)), {})
    found = registered_beside(start, share * MAX_EDGE_RESIDUAL * EDGE_SIGMA_MM)
    monkeypatch.setattr(registration, "register_views", lambda *known, **options: found)
    result = register_solution(start, [], GENERIC)
    if share > 1:
        why = "what would follow contradicts the landmarks"
        assert result.notes == (INCONSISTENT_REGISTRATION.format(why),)
        assert result.matches == ()
        np.testing.assert_array_equal(result.vertices, start.vertices)
        assert (result.uncertainty_mm > found.deviation_mm).all()
    else:
        assert result.notes == ()
        assert [count for count, _ in result.matches] == [1000] * 3
        np.testing.assert_array_equal(result.vertices, found.vertices)
        np.testing.assert_array_equal(result.uncertainty_mm, found.deviation_mm)


def test_marks_by_hand_alone_contradict_nothing(
    start: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They have been part of the registration."""
    found = registered_beside(start, 30.0)
    monkeypatch.setattr(registration, "register_views", lambda *known, **options: found)
    assert register_solution(start, [], GENERIC).notes == ()


def test_a_photo_that_turns_too_far_is_named(start: Solution) -> None:
    away = (at(-65), *start.cameras[1:])
    notes = registration._far_turned(["a", "b", "c"], away, start.cameras)
    assert len(notes) == 1
    assert notes[0].startswith("a: was turned by 35 degrees")
