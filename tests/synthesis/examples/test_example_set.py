"""Examples have the same points, and geometries without head motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.assets.subregions import Subregions
from mien.errors import InputError
from mien.numeric.planar_similarity import PlanarSimilarity
from mien.synthesis.examples.example_set import Example, ExampleSet

TURNED = PlanarSimilarity(np.array(0.9), np.array(0.1), np.array([7.0, -3.0]))
PHOTO = np.zeros((120, 100, 3), np.uint8)


@pytest.fixture(scope="module")
def layout():
    return load_feature_layout()


@pytest.fixture
def example_set(layout):
    """A face at rest, and the same one after its head has moved."""
    points = 50 + 60 * layout.template
    neutral = Example("neutral", PHOTO, points, "frame_000001.png")
    moved = Example("moved", PHOTO, TURNED(points), "frame_000002.png")
    fades = np.ones((120, 100, 1), np.float32)
    subregions = Subregions(("face",), fades, (np.arange(len(points)),))
    return ExampleSet(layout, (neutral, moved), 1, points[None], subregions)


def test_geometries_are_free_of_head_motion(example_set):
    rest = example_set.neutral.points
    np.testing.assert_allclose(example_set.geometries, np.stack([rest, rest]), atol=1e-9)


def test_a_geometry_that_an_expression_changes_is_not_neutral(example_set):
    points = np.array(example_set.neutral.points)
    points[example_set.layout.index("menton")] += [0, 10]
    assert np.abs(example_set.geometry(points) - example_set.neutral.points).max() > 5


def test_many_frames_at_once(example_set):
    points = np.stack([TURNED(example_set.neutral.points)] * 3)
    assert example_set.geometry(points).shape == (3, *example_set.neutral.points.shape)


def test_arrays_cannot_be_changed(example_set):
    for array in (example_set.neutral.points, example_set.geometries, example_set.statistics):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0


def test_the_callers_points_stay_changeable(layout):
    points = np.array(layout.template)
    Example("neutral", PHOTO, points, "a.png")
    points[0] = 0


@pytest.mark.parametrize(
    ("photo", "points", "message"),
    [
        (PHOTO[..., 0], np.zeros((3, 2)), "photo of joy: expected an"),
        (PHOTO, np.full((3, 2), np.nan), "points of joy: expected finite numbers"),
        (PHOTO, np.zeros((3, 3)), "points of joy: expected shape"),
    ],
)
def test_bad_examples(photo, points, message):
    with pytest.raises(InputError, match=message):
        Example("joy", photo, points, "joy.png")


def test_teeth_are_indices_of_examples(example_set):
    assert replace(example_set, teeth=(1,)).teeth == (1,)
    with pytest.raises(InputError, match="teeth: expected the index of one of 2 examples, got 2"):
        replace(example_set, teeth=(0, 2))


def test_at_least_one(example_set):
    with pytest.raises(InputError, match="at least one, the neutral face"):
        replace(example_set, examples=())


def test_names_are_unique(example_set):
    with pytest.raises(InputError, match="'neutral' twice"):
        replace(example_set, examples=(example_set.neutral,) * 2)


def test_all_points_are_of_the_layout(example_set):
    few = Example("few", PHOTO, np.zeros((5, 2)), "few.png")
    with pytest.raises(InputError, match=r"points of few: expected shape \(134, 2\)"):
        replace(example_set, examples=(example_set.neutral, few))


def test_the_standard_image_is_an_example(example_set):
    with pytest.raises(InputError, match="standard: expected the index of one of 2"):
        replace(example_set, standard=2)


def test_subregions_are_drawn_over_the_standard_image(example_set):
    drawn = replace(example_set.subregions, fades=np.ones((10, 10, 1), np.float32))
    with pytest.raises(InputError, match="fades: expected shape"):
        replace(example_set, subregions=drawn)


def test_statistics_are_of_the_layout(example_set):
    with pytest.raises(InputError, match="statistics"):
        replace(example_set, statistics=np.zeros((4, 5, 2)))


def test_subregions_over_another_layout(example_set):
    other = replace(example_set.subregions, members=(np.array([3, 134]),))
    with pytest.raises(InputError, match="members of face: expected points from 0 to 133, got 134"):
        replace(example_set, subregions=other)
