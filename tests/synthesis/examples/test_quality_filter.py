"""Pictures that are no good whatever they show: cut, occluded, small."""

from __future__ import annotations

import numpy as np

from mien.synthesis.examples.quality_filter import CUT, OCCLUDED, rejection_reasons

FACE = np.array([[100.0, 100.0], [200.0, 100.0], [150.0, 220.0]])
SIZES = np.tile([300, 300], (5, 1))
NONE = np.zeros(5, bool)


def test_faces_that_the_edge_cuts():
    points = np.tile(FACE, (5, 1, 1))
    points[1] += [0, 90]  # Its chin is 10 px below the edge, a tenth of its width.
    points[2] += [0, 81]  # 1 px is within the error of the points.
    points[3] -= [103, 0]
    assert rejection_reasons(points, SIZES, NONE) == ("", CUT, "", CUT, "")


def test_pictures_of_several_sizes():
    points, sizes = np.tile(FACE, (3, 1, 1)), np.array([[300, 300], [150, 300], [300, 300]])
    assert rejection_reasons(points, sizes, NONE[:3]) == ("", CUT, "")


def test_small_ones():
    points = np.tile(FACE, (5, 1, 1))
    points[4] *= 0.7
    assert rejection_reasons(points, SIZES, NONE)[3:] == ("", "small, 70% of the usual width")


def test_occluded_ones_and_the_first_reason_counts():
    points = np.tile(FACE, (5, 1, 1))
    points[1] += [0, 90]
    occluded = np.array([False, True, True, False, False])
    assert rejection_reasons(points, SIZES, occluded) == ("", CUT, OCCLUDED, "", "")


def test_what_most_pictures_have_is_no_fault():
    points = np.tile(FACE + np.array([0, 90]), (5, 1, 1))
    points[0] -= [0, 90]
    assert rejection_reasons(points, SIZES, NONE) == ("",) * 5
