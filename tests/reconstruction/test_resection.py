"""Exact cameras from exact points of a head that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marbled import GENERIC
from mien.capture.annotations import Annotations
from mien.errors import EstimationError
from mien.reconstruction.features import gather_features
from mien.reconstruction.resection import resect_cameras
from people import camera, cameras, person, photographed

HEAD = person(4)
FIVE = cameras()


def test_exact_points_give_the_exact_cameras() -> None:
    views = [photographed(HEAD, item, name=f"{k}.png") for k, item in enumerate(FIVE)]
    focal = np.array([item.focal_px for item in FIVE])
    found = resect_cameras(views, gather_features(views, GENERIC), focal, HEAD)
    for item, true in zip(found, FIVE, strict=True):
        np.testing.assert_allclose(item.R_cam_head, true.R_cam_head, atol=1e-6)
        np.testing.assert_allclose(item.t_cam_head / 700, true.t_cam_head / 700, atol=1e-6)
        assert item.focal_px == true.focal_px
        assert (item.width, item.height) == (true.width, true.height)


def test_a_photo_of_another_size_and_lens_beside() -> None:
    near = replace(camera(20, distance=400), width=640, height=480, principal_px=None)
    views = [photographed(HEAD, item) for item in (FIVE[0], near)]
    pixels = np.zeros((480, 640, 3), np.uint8)
    views[1] = replace(views[1], photo=replace(views[1].photo, pixels=pixels))
    features = gather_features(views, GENERIC)
    found = resect_cameras(views, features, np.array([FIVE[0].focal_px, near.focal_px]), HEAD)
    assert (found[1].width, found[1].height) == (640, 480)
    np.testing.assert_allclose(found[1].t_cam_head, near.t_cam_head, atol=1e-3)


def test_a_wrong_lens_is_made_up_for_by_the_distance() -> None:
    views = [photographed(HEAD, FIVE[2], landmarks=True)]
    features = gather_features(views, GENERIC)
    (found,) = resect_cameras(views, features, np.array([1.3 * FIVE[2].focal_px]), HEAD)
    assert found.t_cam_head[2] == pytest.approx(1.3 * FIVE[2].t_cam_head[2], rel=0.03)


@pytest.mark.parametrize("count", [1, 3])
def test_too_few_points(count: int) -> None:
    view = photographed(HEAD, FIVE[2], name="me.png", points=list(GENERIC.points)[:count])
    features = gather_features([view], GENERIC)
    with pytest.raises(EstimationError, match=rf"^me\.png: {count} points are too few for a cam"):
        resect_cameras([view], features, np.array([2000.0]), HEAD)


def test_four_points_are_enough() -> None:
    names = ["right_eye_outer", "left_eye_outer", "nose_tip", "chin"]
    view = photographed(HEAD, FIVE[2], points=names)
    features = gather_features([view], GENERIC)
    (found,) = resect_cameras([view], features, np.array([FIVE[2].focal_px]), HEAD)
    np.testing.assert_allclose(
        found.project(features.on(HEAD)), features.image_points[0], atol=0.01
    )


def test_points_that_no_camera_sees_so() -> None:
    names = list(GENERIC.points)
    marks = Annotations(dict.fromkeys(names, np.array([500.0, 600.0])))
    view = replace(photographed(HEAD, FIVE[2], name="me.png"), annotations=marks)
    features = gather_features([view], GENERIC)
    with pytest.raises(EstimationError, match=r"^me\.png: no camera sees its points so$"):
        resect_cameras([view], features, np.array([2000.0]), HEAD)
