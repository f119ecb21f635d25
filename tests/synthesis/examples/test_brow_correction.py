"""Brows that are painted where the points are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.synthesis.examples.brow_correction import correct_brows, detected_points

WIDTH = 300
SKIN, HAIR = (200, 160, 140), (70, 50, 40)


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


@pytest.fixture
def points(layout):
    return WIDTH * layout.template + np.array([200, 230])


def rows_of(layout, side):
    return [i for i, name in enumerate(layout.names) if name.startswith(f"{side}_brow_")]


def outline(layout, side):
    """Rows around a brow: its upper edge, and back along its lower one."""
    upper = [i for i in rows_of(layout, side) if "upper" in layout.names[i]]
    lower = [i for i in rows_of(layout, side) if "lower" in layout.names[i]]
    return upper + lower[::-1]


def painted(layout, points):
    """A face of skin with brows where the points are."""
    picture = np.full((520, 420, 3), SKIN, np.uint8)
    for side in ("right", "left"):
        polygon = np.rint((points[outline(layout, side)] - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(picture, [polygon], HAIR, lineType=cv2.LINE_AA, shift=4)
    return picture


def raised(layout, points, side, inner, outer):
    """The points with a brow's inner end and tail higher by so many widths of the face."""
    moved = points.copy()
    upper = [i for i in rows_of(layout, side) if "upper" in layout.names[i]]
    lower = [i for i in rows_of(layout, side) if "lower" in layout.names[i]]
    for rows, last in ((upper, len(upper) - 1), (lower, len(lower))):
        along = np.arange(len(rows)) / last
        moved[rows, 1] -= WIDTH * ((1 - along) * inner + along * outer)
    return moved


def test_correct_brows_stay(layout, points):
    found = correct_brows(layout, painted(layout, points), points)
    assert np.abs(found - points).max() < 0.005 * WIDTH


@pytest.mark.parametrize(("inner", "outer"), [(0.08, 0.08), (0.07, 0.04), (0.03, 0.07)])
def test_a_raised_brow_is_found_and_the_rest_of_the_face_stays(layout, points, inner, outer):
    true = raised(layout, points, "left", inner, outer)
    found = correct_brows(layout, painted(layout, true), points)
    off = np.linalg.norm(found - true, axis=1) / WIDTH
    assert off[rows_of(layout, "left")].max() < 0.015
    others = np.setdiff1d(np.arange(len(points)), rows_of(layout, "left"))
    others = [i for i in others if "forehead" not in layout.names[i]]
    assert np.abs(found - points)[others].max() < 0.005 * WIDTH


def test_a_brow_does_not_overtake_the_forehead(layout, points):
    """One as high as the forehead's points pushes them up; what folds is torn."""
    points = points.copy()
    skin = [i for i, name in enumerate(layout.names) if "forehead" in name]
    points[skin, 1] += 0.05 * WIDTH
    before = folded(layout, points)
    true = raised(layout, points, "left", 0.08, 0.08)
    assert folded(layout, true) > before
    found = correct_brows(layout, painted(layout, true), points)
    assert folded(layout, found) == before
    half = layout.index("forehead")
    lift = (points - found)[:, 1]
    assert lift[half] == pytest.approx(0.08 * WIDTH * 0.5 * 0.55, abs=0.015 * WIDTH)
    assert lift[layout.index("left_forehead.0")] > lift[half]
    assert lift[layout.index("right_forehead.0")] < 0.005 * WIDTH


def folded(layout, points):
    """How many triangles lie the other way round than on the template."""

    def sides(positions):
        corners = np.concatenate([positions, layout.frame(positions)])[layout.triangles]
        return np.sign(np.linalg.det(np.diff(corners, axis=1)))

    return int((sides(points) * sides(WIDTH * layout.template) < 0).sum())


def test_a_head_on_its_side(layout, points):
    """Up is up in the face."""
    true = raised(layout, points, "right", 0.06, 0.06)
    picture = np.rot90(painted(layout, true))

    def turned(positions):
        return np.column_stack([positions[:, 1], 420 - positions[:, 0]])

    found = correct_brows(layout, picture, turned(points))
    off = np.linalg.norm(found - turned(true), axis=1)
    assert off[rows_of(layout, "right")].max() < 0.015 * WIDTH


def test_a_face_without_brows_stays(layout, points, rng):
    picture = np.full((520, 420, 3), SKIN, np.uint8)
    noise = rng.normal(scale=4, size=picture.shape)
    np.testing.assert_array_equal(correct_brows(layout, picture, points), points)
    noisy = (picture + noise).clip(0, 255).astype(np.uint8)
    np.testing.assert_array_equal(correct_brows(layout, noisy, points), points)


def test_a_fringe_is_no_brow(layout, points):
    """Hair from the top of the picture down to just above the brows."""
    picture = painted(layout, points)
    top = points[rows_of(layout, "left")][:, 1].min()
    picture[: round(top - 0.03 * WIDTH)] = HAIR
    assert np.abs(correct_brows(layout, picture, points) - points).max() < 0.005 * WIDTH


def test_points_do_not_jump(layout, points):
    """A brow that rises in steps of a hundredth of the face's width."""
    steps = np.linspace(0, 0.08, 9)
    found = [
        correct_brows(layout, painted(layout, raised(layout, points, "left", up, up)), points)
        for up in steps
    ]
    heights = -np.array([f[rows_of(layout, "left"), 1].mean() for f in found]) / WIDTH
    assert (np.diff(heights) > -0.002).all()
    assert np.diff(heights).max() < 0.045


def test_landmarks_and_outside(layout, points):
    landmarks = np.linalg.lstsq(layout.landmark_weights, points, rcond=None)[0]
    true = raised(layout, points, "left", 0.06, 0.06)
    found = detected_points(layout, painted(layout, true), landmarks)
    assert np.linalg.norm(found - true, axis=1)[rows_of(layout, "left")].max() < 0.015 * WIDTH
    away = detected_points(layout, painted(layout, true), landmarks + 5000)
    np.testing.assert_allclose(away, points + 5000, atol=0.01)


def test_points_in_one_place_stay(layout, points):
    same = np.full_like(points, 7.0)
    np.testing.assert_array_equal(correct_brows(layout, painted(layout, points), same), same)
