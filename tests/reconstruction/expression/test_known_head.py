"""Landmarks that mean other points than those that they are attached to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from expressive import NEUTRAL, exactly_detected, known_head, making, neutral_photo, weights_of
from marbled import GENERIC, at
from mien.arrays import Array
from mien.camera import Camera
from mien.capture.annotations import Annotations
from mien.capture.faces.landmarks import Landmarks
from mien.capture.source import CapturedView
from mien.reconstruction.expression.known_head import (
    EXPRESSED_EDGE_MM,
    EXPRESSED_SKIN_MM,
    KnownHead,
    feature_observations,
)
from mien.reconstruction.features import POINT_SIGMA_MM, gather_features
from mien.reconstruction.observations import SurfaceObservations

OFF_MM = np.random.default_rng(2).normal(size=(478, 3))
"""By how much this detector means other points, on any head."""
CAMERA = at(5, 2)
TRUE = making(weights_of(mouthSmile=0.6, jawOpen=0.3))


def detected(seen_from: Camera, vertices: Array, confidence: Array | None = None) -> CapturedView:
    points = seen_from.project(GENERIC.landmark_positions(vertices) + OFF_MM)
    sure = np.ones(478) if confidence is None else confidence
    landmarks = Landmarks(points, sure, np.zeros(52), seen_from.R_cam_head)
    return replace(neutral_photo(), landmarks=landmarks)


def known_from(cameras: Sequence[Camera], confidence: Array | None = None) -> KnownHead:
    views = [detected(item, NEUTRAL, confidence) for item in cameras]
    return KnownHead(views, cameras, NEUTRAL, GENERIC.unit_offsets, GENERIC)


def sightings_in(view: CapturedView, known: KnownHead) -> SurfaceObservations:
    return feature_observations(gather_features([view], GENERIC), known)


def off_px(seen: SurfaceObservations) -> Array:
    """(M,) how far the photo shows them off where they are expected on the true head."""
    there = CAMERA.project(seen.on(TRUE) + seen.offset)
    return np.linalg.norm(there - seen.image_points, axis=1)


def share_believed(cameras: Sequence[Camera]) -> float:
    """Of the offsets of landmarks on edges, as the expression's camera sees them."""
    features = gather_features([detected(CAMERA, TRUE)], GENERIC)
    # Irises are left out.
    on_face = GENERIC.regions["face"][features.corners].max(axis=1) > 0
    numbers = np.array([int(name.split()[1]) for name in features.names])[on_face]
    edges = features.on_edges[on_face]
    found = feature_observations(features, known_from(cameras)).offset[edges]
    across = CAMERA.R_cam_head[:2]
    true = (OFF_MM[numbers][edges]) @ across.T
    return float(((found @ across.T) * true).sum() / (true**2).sum())


def test_what_neutral_photos_show_beside_its_place_is_there_in_the_expression() -> None:
    view = detected(CAMERA, TRUE)
    plain = sightings_in(view, known_head())
    np.testing.assert_allclose(plain.offset, 0, atol=1e-9)
    corrected = sightings_in(view, known_from([at(yaw) for yaw in (-20, -10, 0, 10, 20)]))
    edges = corrected.sigma_mm == EXPRESSED_EDGE_MM
    assert np.median(off_px(corrected)[edges]) < 0.4 * np.median(off_px(plain)[edges])
    assert np.median(off_px(corrected)[~edges]) < np.median(off_px(plain)[~edges])


def test_more_photos_are_believed_more() -> None:
    """As n / (n + h): one photo may have been a bad day of the detector's."""
    one = share_believed([at(5)])
    assert 0.4 < one < 0.7
    half = 1 / one - 1
    nine = share_believed([at(yaw) for yaw in np.linspace(-4, 14, 9)])
    assert nine == pytest.approx(9 / (9 + half), abs=0.03)


def test_a_detector_that_was_unsure_is_believed_less() -> None:
    view = detected(CAMERA, TRUE)
    sure, unsure = (
        np.linalg.norm(sightings_in(view, known_from([at(0)], confidence)).offset, axis=1)
        for confidence in (np.ones(478), np.full(478, 0.3))
    )
    assert (unsure < 0.6 * sure).all()
    unseen = sightings_in(view, known_from([at(0)], np.zeros(478)))
    np.testing.assert_array_equal(unseen.offset, 0)


def test_how_far_sightings_are_trusted() -> None:
    names = ("chin", "nose_tip")
    points = CAMERA.project(TRUE[[GENERIC.vertex_of(name) for name in names]])
    view = replace(
        exactly_detected(neutral_photo(), CAMERA, TRUE),
        annotations=Annotations(dict(zip(names, points, strict=True))),
    )
    features = gather_features([view], GENERIC)
    seen = feature_observations(features, known_from([at(0)]))
    on_face = GENERIC.regions["face"][features.corners].max(axis=1) > 0
    assert len(seen.photo) == (features.observed[0] & on_face).sum(), "irises turn by themselves"
    by_hand = seen.sigma_mm == POINT_SIGMA_MM
    assert by_hand.sum() == 2
    np.testing.assert_allclose(seen.image_points[by_hand], points)
    np.testing.assert_array_equal(seen.offset[by_hand], 0)
    assert set(seen.sigma_mm[~by_hand]) == {EXPRESSED_EDGE_MM, EXPRESSED_SKIN_MM}
    np.testing.assert_array_equal(
        seen.sigma_mm[~by_hand] == EXPRESSED_EDGE_MM,
        features.on_edges[features.observed[0] & on_face][~by_hand],
    )


def test_photos_without_landmarks_say_nothing() -> None:
    known = known_head()
    silent = replace(known, views=[replace(view, landmarks=None) for view in known.views])
    seen = sightings_in(detected(CAMERA, TRUE), silent)
    np.testing.assert_array_equal(seen.offset, 0)
