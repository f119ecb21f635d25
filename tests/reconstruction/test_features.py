from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mien.assets.generic import load_generic_head
from mien.capture.annotations import Annotations
from mien.capture.source import CapturedView
from mien.errors import InputError
from mien.reconstruction.features import (
    CURVE_SIGMA_MM,
    MARK_RADIUS_MM,
    MIN_CONFIDENCE,
    MIN_NAMED_POINTS,
    POINT_SIGMA_MM,
    Features,
    gather_features,
    image_points_for_cameras,
    rematch_curves,
)
from people import camera, drawn, person, photographed

GENERIC = load_generic_head()
PERSON = person(3)
FRONT, SIDE = camera(0), camera(45, 15)


def column(features: Features, name: str) -> int:
    return features.names.index(name)


def is_landmark(features: Features) -> np.ndarray:
    return np.array([name.startswith("landmark") for name in features.names])


def without_confidence(view: CapturedView, numbers: list[int], confidence: float) -> CapturedView:
    assert view.landmarks is not None
    known = np.array(view.landmarks.confidence)
    known[numbers] = confidence
    return replace(view, landmarks=replace(view.landmarks, confidence=known))


def test_every_named_place_is_one_feature() -> None:
    features = gather_features([photographed(PERSON, FRONT)], GENERIC)
    vertices = {GENERIC.vertex_of(name) for name in GENERIC.feature_names}
    assert len(features.names) == len(set(features.names)) == len(vertices)
    assert set(features.corners[:, 0]) == vertices
    assert set(GENERIC.points) <= set(features.names)


def test_features_lie_on_the_head_that_was_photographed() -> None:
    view = photographed(PERSON, SIDE, landmarks=True, points=["nose_tip"])
    features = gather_features([view], GENERIC)
    np.testing.assert_allclose(
        SIDE.project(features.on(PERSON)), features.image_points[0], atol=1e-9
    )


def test_features_on_a_stack_of_offsets() -> None:
    features = gather_features([photographed(PERSON, FRONT, landmarks=True)], GENERIC)
    stack = GENERIC.identity.components[:3]
    expected = np.stack([features.on(item) for item in stack])
    np.testing.assert_allclose(features.on(stack), expected, atol=1e-12)


def test_deviations_tell_what_kind_of_mark_it_is() -> None:
    view = photographed(PERSON, FRONT, points=["chin"], curves=["hairline"], landmarks=True)
    far = 33  # A landmark at the eye, far from the chin and the hairline.
    sure = gather_features([view], GENERIC)
    doubtful = gather_features([without_confidence(view, [far], 0.5)], GENERIC)
    sigma, at = doubtful.sigma_mm[0], column(sure, f"landmark {far}")
    assert sigma[column(doubtful, "chin")] == POINT_SIGMA_MM
    assert sigma[column(doubtful, "hairline.4")] == CURVE_SIGMA_MM
    assert sigma[at] == 2 * sure.sigma_mm[0, at] > 2 * CURVE_SIGMA_MM
    assert (doubtful.by_hand[0] == ~is_landmark(doubtful)).all()


def test_a_landmark_without_confidence_is_not_used() -> None:
    view = photographed(PERSON, FRONT, points=(), landmarks=True)
    views = [without_confidence(view, [33], MIN_CONFIDENCE / 2), view]
    features = gather_features(views, GENERIC)
    assert features.observed[:, column(features, "landmark 33")].tolist() == [False, True]
    assert np.isnan(features.image_points[0, column(features, "landmark 33")]).all()
    assert "landmark 33" not in gather_features(views[:1], GENERIC).names


def test_landmarks_along_the_silhouette_are_not_used() -> None:
    features = gather_features([photographed(PERSON, FRONT, points=(), landmarks=True)], GENERIC)
    assert {"landmark 1", "landmark 33"} <= set(features.names)
    assert not {"landmark 10", "landmark 152", "landmark 234"} & set(features.names)


def test_a_named_point_wins_over_the_curve_through_it() -> None:
    view = photographed(PERSON, FRONT, points=["nose_ridge.2"], curves=["nose_ridge"])
    assert view.annotations is not None
    named = np.array([3.0, 4.0])
    marks = Annotations({"nose_ridge.2": named}, view.annotations.curves)
    features = gather_features([replace(view, annotations=marks)], GENERIC)
    shown = features.image_points[0]
    np.testing.assert_array_equal(shown[column(features, "nose_ridge.2")], named)
    expected = view.annotations.points["nose_ridge.2"]
    assert np.linalg.norm(shown[column(features, "nose_ridge.1")] - expected) < 60


def test_marks_by_hand_silence_the_landmarks_near_them_in_that_photo() -> None:
    marked = photographed(PERSON, FRONT, points=["chin"], landmarks=True)
    bare = photographed(PERSON, SIDE, points=(), landmarks=True)
    features = gather_features([marked, bare], GENERIC)
    places = features.on(GENERIC.mesh.vertices)
    chin = places[column(features, "chin")]
    near = np.linalg.norm(places - chin, axis=1) < MARK_RADIUS_MM
    landmarks = is_landmark(features)
    assert (near & landmarks).sum() > 10
    assert not features.observed[0, near & landmarks].any()
    assert features.observed[0, ~near].all()
    assert features.observed[1, landmarks].all()
    assert np.isnan(features.image_points[0, near & landmarks]).all()


def test_what_no_photo_shows_is_dropped() -> None:
    views = [photographed(PERSON, FRONT, points=["chin", "nose_tip"])]
    views.append(photographed(PERSON, SIDE, points=["nose_tip"]))
    features = gather_features(views, GENERIC)
    assert sorted(features.names) == ["chin", "nose_tip"]
    assert features.of_photos(np.array([False, True])).names == ("nose_tip",)


@pytest.mark.parametrize("curve", [[[5.0, 5.0]], [[5.0, 5.0], [5.0, 5.0]]])
def test_a_curve_without_length_names_its_photo(curve: list[list[float]]) -> None:
    view = photographed(PERSON, FRONT, name="me.png", points=())
    marks = Annotations({}, {"left_jaw": np.array(curve)})
    with pytest.raises(InputError, match=r"me\.png: curves\.left_jaw: expected two"):
        gather_features([replace(view, annotations=marks)], GENERIC)


@pytest.mark.parametrize("name", ["left_jaw", "right_jaw", "nose_ridge"])
def test_curves_matched_by_epipolar_lines_meet_better_than_by_arc_length(name: str) -> None:
    """The same place in space in both photos, which is what intersecting rays needs."""
    views = [photographed(PERSON, item, points=(), curves=[name]) for item in (FRONT, SIDE)]
    by_length = gather_features(views, GENERIC)
    matched = rematch_curves(by_length, views, [FRONT, SIDE], GENERIC)
    off_by_length, off_matched = (_apart_px(item, name) for item in (by_length, matched))
    assert np.median(off_by_length) > 2
    assert np.median(off_matched) < 0.1 * np.median(off_by_length)
    assert off_matched.max() < off_by_length.max()


def _apart_px(features: Features, name: str) -> np.ndarray:
    """How far apart, in the second photo, what both photos show of each place lies."""
    line = drawn(PERSON, name)
    fine = np.linspace(0, len(line) - 1, 20_000)
    steps = np.arange(len(line))
    line = np.column_stack([np.interp(fine, steps, line[:, axis]) for axis in range(3)])
    inner = [f"{name}.{index}" for index in range(1, len(GENERIC.polylines[name]) - 1)]
    columns = [column(features, item) for item in inner]
    seen_first = cKDTree(FRONT.project(line)).query(features.image_points[0, columns])[1]
    seen_second = cKDTree(SIDE.project(line)).query(features.image_points[1, columns])[1]
    places = SIDE.project(line)
    return np.linalg.norm(places[seen_first] - places[seen_second], axis=1)


def test_rematching_leaves_named_points_and_single_curves_alone() -> None:
    views = [
        photographed(PERSON, FRONT, points=["left_jaw.3"], curves=["left_jaw", "hairline"]),
        photographed(PERSON, SIDE, points=["left_jaw.3"], curves=["left_jaw"]),
    ]
    before = gather_features(views, GENERIC)
    after = rematch_curves(before, views, [FRONT, SIDE], GENERIC)
    moved = (np.nan_to_num(before.image_points) != np.nan_to_num(after.image_points)).any(axis=2)
    assert moved.any()
    vertices = set(before.corners[moved.any(axis=0), 0])
    assert vertices <= set(GENERIC.polylines["left_jaw"]) - {GENERIC.vertex_of("left_jaw.3")}
    assert moved.any(axis=1).sum() == 1, "one photo is the reference"


def test_cameras_start_without_the_curves_where_points_suffice() -> None:
    """[Pighin 2002] sec. 5.1.3: curves refine the shape; arc length would falsify the cameras."""
    few, many = list(GENERIC.points)[:4], list(GENERIC.points)[:MIN_NAMED_POINTS]
    views = [photographed(PERSON, FRONT, points=p, curves=["hairline"]) for p in (few, many)]
    features = gather_features(views, GENERIC)
    used = np.isfinite(image_points_for_cameras(features)).all(axis=2)
    assert used[0].sum() == features.observed[0].sum()
    assert used[1].sum() == MIN_NAMED_POINTS
    assert features.observed[1].sum() > MIN_NAMED_POINTS
