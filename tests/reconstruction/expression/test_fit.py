"""Expressions of a marbled person that are known, fitted from the photos alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from expressive import (
    FACE,
    NEUTRAL,
    SKIN,
    bump,
    exactly_detected,
    known_head,
    looking,
    making,
    neutral_photo,
    off_px,
    weights_of,
)
from marbled import GENERIC, Person, at
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.annotations import Annotations
from mien.capture.faces.detector import NO_FACE_FOUND
from mien.capture.faces.mediapipe_face import BLENDSHAPE_NAMES
from mien.capture.source import CapturedView
from mien.errors import EstimationError
from mien.numeric.rotation import angle_between
from mien.reconstruction.expression.fit import (
    INCONSISTENT_SKIN,
    SAME_CAMERA_SD,
    _expected_units,
    _focal_lengths,
    fit_expression,
)
from mien.reconstruction.landmark_fit import FOCAL_PRIOR_DEVIATION
from mien.reconstruction.result import ExpressionFit

WEIGHTS = weights_of(mouthSmile=0.7, browInnerUp=0.6, jawOpen=0.3)
RESIDUAL = sum(
    bump(GENERIC.mesh.vertices[GENERIC.vertex_of(name)] + shift, width_mm=15, along=along)
    for name, shift, along in (
        ("left_mouth_corner", [15, 5, 0], (1.5, 1.0, 0.5)),
        ("nose_root", [0, 20, 0], (0.0, -1.5, 0.5)),
    )
)
"""What no unit can express."""
CAMERAS = {"one photo": [at(6, -3)], "three photos": [at(-22, 3), at(4), at(24, -3)]}


def shown(vertices: Array, cameras: Sequence[Camera]) -> list[CapturedView]:
    who = Person(vertices, 1)
    return [
        exactly_detected(who.seen_by(item, name=f"{k}.png"), item, vertices)
        for k, item in enumerate(cameras)
    ]


@cache
def smiling() -> Array:
    vertices = making(WEIGHTS)
    vertices[SKIN] += RESIDUAL[SKIN]
    return vertices


@cache
def fitted(photos: str) -> ExpressionFit:
    return fit_expression(shown(smiling(), CAMERAS[photos]), known_head())


@pytest.fixture(params=CAMERAS)
def photos(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def test_the_photos_see_the_face_where_it_is(photos: str) -> None:
    fit = fitted(photos)
    for k, true in enumerate(CAMERAS[photos]):
        found = fit.photos[f"{k}.png"].camera
        off = off_px(fit.vertices, smiling(), found, true)
        assert np.median(off) < 0.1
        assert off.max() < 1
        assert np.degrees(angle_between(found.R_cam_head, true.R_cam_head)) < 0.3
        assert found.focal_px == pytest.approx(true.focal_px, rel=0.04)


def test_the_shape_is_the_persons(photos: str) -> None:
    """Depth that one photo does not tell is the units': the residual has some of its own."""
    fit = fitted(photos)
    off = np.linalg.norm(fit.vertices - smiling(), axis=1)[FACE]
    assert np.median(off) < 0.15
    assert off.max() < 1
    plain = np.linalg.norm(making(WEIGHTS) - smiling(), axis=1)[FACE]
    assert plain.max() > 1.4
    assert off[plain > 1].mean() < 0.5 * plain[plain > 1].mean()


def test_the_units_explain_what_units_made(photos: str) -> None:
    """The residual's share of what looks like a unit is all that is off."""
    np.testing.assert_allclose(fitted(photos).units, WEIGHTS, atol=0.15)
    steady = [name.startswith("eyeLook") for name in GENERIC.unit_names]
    assert not fitted(photos).units[steady].any()


def test_everything_stays_in_the_neutral_heads_frame(photos: str) -> None:
    regions = GENERIC.regions
    still = SKIN[(regions["scalp"] + regions["left_ear"] + regions["right_ear"])[SKIN] > 0.99]
    np.testing.assert_allclose(fitted(photos).vertices[still], NEUTRAL[still], atol=0.2)
    ball = GENERIC.mesh.vertices_of("left_eyeball")
    np.testing.assert_allclose(fitted(photos).vertices[ball], NEUTRAL[ball], atol=1e-9)


def test_marks_tell_where_the_fit_puts_them() -> None:
    fit = fitted("one photo")
    item = fit.photos["0.png"]
    assert not fit.left_out
    assert len(item.marks) > 300
    assert all(not mark.rejection for mark in item.marks)
    assert np.median([mark.distance_px for mark in item.marks]) < 0.5


def test_a_photo_without_a_face_is_left_out_and_the_rest_comes_out_the_same() -> None:
    (view,) = shown(smiling(), CAMERAS["one photo"])
    faceless = replace(view, landmarks=None, photo=replace(view.photo, name="back.png"))
    told: list[tuple[int, int]] = []
    fit = fit_expression(
        [faceless, view], known_head(), progress=lambda done, total: told.append((done, total))
    )
    assert fit.left_out == {"back.png": NO_FACE_FOUND}
    assert list(fit.photos) == ["0.png"]
    for name in ("vertices", "units", "gaze"):
        same = getattr(fitted("one photo"), name)
        np.testing.assert_array_equal(getattr(fit, name), same)
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_no_face_at_all() -> None:
    (view,) = shown(smiling(), CAMERAS["one photo"])
    faceless = [
        replace(view, landmarks=None, photo=replace(view.photo, name=name))
        for name in ("a.png", "b.png")
    ]
    with pytest.raises(
        EstimationError, match=rf"^a\.png: {NO_FACE_FOUND}; b\.png: {NO_FACE_FOUND}"
    ):
        fit_expression(faceless, known_head())


def test_too_few_marks_leave_a_photo_out() -> None:
    (view,) = shown(smiling(), CAMERAS["one photo"])
    points = {name: np.array([100.0, 100.0]) for name in ("chin", "nose_tip", "nose_root")}
    few = replace(
        view,
        landmarks=None,
        annotations=Annotations(points, {}),
        photo=replace(view.photo, name="few.png"),
    )
    fit = fit_expression([view, few], known_head())
    assert fit.left_out == {"few.png": "3 points are too few for a camera"}
    with pytest.raises(EstimationError, match=r"few\.png: 3 points"):
        fit_expression([few], known_head())


def test_skin_that_is_not_neutrals_leads_nothing() -> None:
    """Another person's skin under exact landmarks: landmarks alone decide, and a note says so."""
    (seen_from,) = CAMERAS["one photo"]
    inconsistent = exactly_detected(
        Person(smiling(), 7).seen_by(seen_from, name="0.png"), seen_from, smiling()
    )
    fit = fit_expression([inconsistent], known_head())
    found = fit.photos["0.png"].camera
    assert np.degrees(angle_between(found.R_cam_head, seen_from.R_cam_head)) < 0.5
    assert fit.notes == (INCONSISTENT_SKIN.format("0.png"),)
    assert fitted("one photo").notes == ()


def test_eyes_that_look_aside_are_found_and_move_no_camera() -> None:
    """And one that is shut looks nowhere."""
    (seen_from,) = CAMERAS["one photo"]
    vertices = looking(making(weights_of(mouthSmile=0.4, eyeBlinkLeft=0.9)), -20, 12)
    fit = fit_expression(shown(vertices, [seen_from]), known_head())
    np.testing.assert_array_equal(fit.gaze[0], 0)
    np.testing.assert_allclose(np.degrees(fit.gaze[1]), [-20, 12], atol=0.5)
    found = fit.photos["0.png"].camera
    assert np.degrees(angle_between(found.R_cam_head, seen_from.R_cam_head)) < 0.1
    ball = GENERIC.mesh.vertices_of("left_eyeball")
    np.testing.assert_allclose(fit.vertices[ball], NEUTRAL[ball], atol=1e-9)


def test_frames_of_the_neutral_clip_share_its_lens() -> None:
    (view,) = shown(smiling(), CAMERAS["one photo"])
    clip = Path("clip.mp4")
    same = replace(view, photo=replace(view.photo, path=clip))
    known = known_head()
    neutral = replace(known.views[0], photo=replace(known.views[0].photo, path=clip))
    known = replace(known, views=[neutral])
    focal, deviation = _focal_lengths([same, view], known)
    assert focal[0] == known.cameras[0].focal_px
    np.testing.assert_allclose(deviation, [SAME_CAMERA_SD, FOCAL_PRIOR_DEVIATION])


def test_expected_units_are_what_scores_rise_by() -> None:
    """From 0.2 in neutral to 0.6 is half of what is left to 1; what falls is nothing."""
    neutral, now = np.zeros(52), np.zeros(52)
    rows = [BLENDSHAPE_NAMES.index(name) for name in ("jawOpen", "mouthPucker", "browInnerUp")]
    neutral[rows], now[rows] = (0.2, 0.5, 0.0), (0.6, 0.1, 0.3)
    known = known_head()
    view = known.views[0]
    known = replace(known, views=[exactly_detected(view, at(0), NEUTRAL, scores=neutral)])
    views = [exactly_detected(neutral_photo(), at(0), NEUTRAL, scores=now)]
    expected = weights_of(jawOpen=0.5, browInnerUp=0.3)
    np.testing.assert_allclose(_expected_units(views, known), expected)
    silent = [replace(views[0], landmarks=None)]
    assert not _expected_units(silent, known).any()
