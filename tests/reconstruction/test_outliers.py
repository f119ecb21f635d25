"""Verdicts on marks and photos, from residuals that are made up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.assets.generic import load_generic_head
from mien.reconstruction.features import gather_features
from mien.reconstruction.outliers import (
    classify_marks,
    depth_notes,
    find_outlier_photo,
    largest_view_angle,
    median_normalized_residuals,
    name_notes,
)
from mien.reconstruction.result import Mark, PhotoFit
from people import camera, person, photographed


def photo_fit(distrusted: int, of: int, *, by_hand: bool = True) -> PhotoFit:
    marks = tuple(
        Mark(
            f"chin {n}", np.zeros(2), np.array([3.0, 4.0]), by_hand, "off" if n < distrusted else ""
        )
        for n in range(of)
    )
    return PhotoFit(camera(0), marks)


def test_a_photo_counts_by_its_trusted_marks() -> None:
    fit = photo_fit(2, 10)
    assert len(fit.inliers) == 8
    assert fit.rms_px == pytest.approx(5.0)
    assert photo_fit(3, 3).rms_px == 0.0


def test_names_are_doubted_when_many_marks_are_distrusted() -> None:
    photos = {"good.jpg": photo_fit(3, 10), "doubtful.jpg": photo_fit(4, 10)}
    (note,) = name_notes(photos)
    assert note.startswith("doubtful.jpg: 4 of its 10 hand-made marks are distrusted")
    assert name_notes({"detected.jpg": photo_fit(10, 10, by_hand=False)}) == ()


def test_typical_misfit_is_the_median_over_what_is_seen() -> None:
    residuals = np.array([[[3.0, 4.0], [0.0, 1.0], [np.nan, np.nan]]])
    assert median_normalized_residuals(residuals, np.full((1, 3), 0.5)) == pytest.approx([6.0])


@pytest.mark.parametrize(
    ("typical", "worst"),
    [
        ([9.0], None),
        ([1.0, 1.2, 3.9], None),
        ([1.0, 1.2, 4.1], 2),
        ([5.0, 6.0, 7.0], None),
        ([30.0, 6.0, 7.0], 0),
    ],
)
def test_the_worst_photo_is_left_out_only_when_it_stands_apart(
    typical: list[float], worst: int | None
) -> None:
    found = find_outlier_photo(np.array(typical))
    assert (found and found[0]) == worst


def test_why_a_photo_is_left_out() -> None:
    _, why = find_outlier_photo(np.array([1.0, 12.34, 2.0])) or (None, "")
    assert why.startswith("its marks lie 12.3 times their expected error off the head that the oth")
    assert why.endswith("(1.5 times there)")


@pytest.mark.parametrize(("yaws", "degrees"), [((0, 0), 0), ((-30, 20), 50), ((0, 10, 4), 10)])
def test_the_spread_of_views_is_that_of_the_two_farthest(
    yaws: tuple[float, ...], degrees: float
) -> None:
    """As the head's origin sees the cameras, which look at a place 30 mm below."""
    assert largest_view_angle([camera(yaw) for yaw in yaws]) == pytest.approx(degrees, abs=0.3)
    assert largest_view_angle([camera(0, 10), camera(0, -15)]) == pytest.approx(25, abs=1.5)


def test_what_views_say_of_depth() -> None:
    assert depth_notes([camera(-5), camera(5)]) == ()
    (alone,) = depth_notes([camera(20)])
    assert alone.startswith("one photo: depth comes from the prior of faces")
    (near,) = depth_notes([camera(-3), camera(3)])
    assert near.startswith("all photos come from within 6 degrees: depth comes from the prior")


@pytest.mark.parametrize(
    ("sigmas", "verdict"), [(4.9, ""), (7.4, "7 times its expected error off")]
)
def test_a_mark_far_off_its_expected_error_gets_a_verdict(sigmas: float, verdict: str) -> None:
    view = photographed(person(0), camera(0), points=["chin", "nose_tip"])
    features = gather_features([view], load_generic_head())
    residuals, sigma_px = np.zeros((len(features.names), 2)), np.full(len(features.names), 2.0)
    residuals[1] = [0.6 * 2 * sigmas, -0.8 * 2 * sigmas]
    first, second = classify_marks(features, 0, residuals, sigma_px)
    assert (first.rejection, second.rejection) == ("", verdict)
    assert second.distance_px == pytest.approx(2 * sigmas)
    assert second.by_hand
    np.testing.assert_array_equal(second.image_point, features.image_points[0, 1])
    assert {first.name, second.name} == {"chin", "nose_tip"}


def test_matches_outweigh_landmarks_but_not_marks_by_hand() -> None:
    detected, marked = (photo_fit(0, 10, by_hand=by_hand) for by_hand in (False, True))
    assert (replace(detected, matches=90, matches_rms_px=1.0).points_used) == 90
    assert replace(detected, matches=90, matches_rms_px=1.0).rms_px == pytest.approx(1.0)
    both = replace(marked, matches=90, matches_rms_px=1.0)
    assert both.points_used == 100
    assert both.rms_px == pytest.approx(np.sqrt((90 * 1 + 10 * 25) / 100))
