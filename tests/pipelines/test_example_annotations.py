"""Annotated points on photos that become examples replace detected ones; neighbours follow."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.capture.images.photos import Photo
from mien.errors import FileFormatError
from mien.io.landmarks.pts import points_to_ibug, save_pts
from mien.io.landmarks.tem import points_to_tem, save_tem
from mien.pipelines.example_annotations import (
    annotation_notes,
    apply_annotations,
    load_annotated_points,
)


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


@pytest.fixture
def points(layout: FeatureLayout) -> Array:
    """Px of a photo 400 wide and 600 high."""
    return 300 * layout.template + 200


@pytest.fixture
def photo(tmp_path: Path) -> Photo:
    """It is read at half its size."""
    pixels = np.zeros((300, 200, 3), np.uint8)
    return Photo("anna.jpg", tmp_path / "anna.jpg", pixels, original_size=(400, 600))


def annotate(photo: Photo, **data: object) -> None:
    folder = photo.path.parent / "annotations"
    folder.mkdir()
    (folder / "anna.json").write_text(json.dumps(data))


def test_no_annotations(layout: FeatureLayout, points: Array, photo: Photo) -> None:
    assert load_annotated_points(photo.path, photo, layout) == {}
    assert apply_annotations(layout, points, {}) is points


def test_all_points_from_a_delineation(layout: FeatureLayout, points: Array, photo: Photo) -> None:
    save_tem(photo.path.with_suffix(".tem"), points_to_tem(layout, points))
    annotated = load_annotated_points(photo.path, photo, layout)
    found = apply_annotations(layout, 100 + 0 * points + layout.template, annotated)
    np.testing.assert_allclose(found, points / 2, atol=1e-3)


def test_some_points_from_ibug(layout: FeatureLayout, points: Array, photo: Photo) -> None:
    save_pts(photo.path.with_suffix(".pts"), points_to_ibug(layout, points))
    annotated = load_annotated_points(photo.path, photo, layout)
    assert 30 <= len(annotated) <= 40
    for name, place in annotated.items():
        np.testing.assert_allclose(place, points[layout.index(name)] / 2, atol=1e-3)


def test_points_of_the_layout_in_json(layout: FeatureLayout, photo: Photo) -> None:
    annotate(photo, layout=layout.name, points={"chin": [200, 500], "right_jaw.0": [150, 480]})
    annotated = load_annotated_points(photo.path, photo, layout)
    np.testing.assert_array_equal(annotated["chin"], [100, 250])
    np.testing.assert_array_equal(annotated["right_jaw.0"], [75, 240])


def test_annotations_for_heads_count_where_they_are_the_same_points(
    layout: FeatureLayout, photo: Photo
) -> None:
    """`left_jaw.3` is another place on the head than among the feature points."""
    annotate(photo, points={"nose_tip": [200, 300], "left_jaw.3": [250, 480], "chin": [200, 500]})
    annotated = load_annotated_points(photo.path, photo, layout)
    assert list(annotated) == ["nose_tip"]
    np.testing.assert_array_equal(annotated["nose_tip"], [100, 150])


def test_json_takes_precedence_over_a_delineation(
    layout: FeatureLayout, points: Array, photo: Photo
) -> None:
    save_tem(photo.path.with_suffix(".tem"), points_to_tem(layout, points))
    annotate(photo, layout=layout.name, points={"chin": [10, 20]})
    np.testing.assert_array_equal(load_annotated_points(photo.path, photo, layout)["chin"], [5, 10])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"layout": "zhang134", "points": {"chinn": [1, 2]}}, "chinn"),
        ({"layout": "zhang134", "points": {"chin": [1]}}, "chin"),
        ({"layout": "zhang134", "points": {"chin": [1, float("nan")]}}, "chin"),
        ({"layout": "ibug", "points": {"chin": [1, 2]}}, "layout"),
        ({"points": {"chinn": [1, 2]}}, "points.chinn: unknown name; did you mean chin"),
    ],
)
def test_broken_annotations(
    layout: FeatureLayout, photo: Photo, data: dict[str, object], message: str
) -> None:
    annotate(photo, **data)
    with pytest.raises(FileFormatError, match=message) as caught:
        load_annotated_points(photo.path, photo, layout)
    assert "anna.json" in str(caught.value)


def test_points_of_other_kinds_are_noted_and_not_used(layout: FeatureLayout, photo: Photo) -> None:
    annotate(photo, layout=layout.name, points={"chin": [200, 500]})
    assert annotation_notes(photo.path, layout) == []
    photo.path.with_suffix(".tem").write_text("2\n1 2\n3 4\n0\n")
    save_pts(photo.path.with_suffix(".pts"), np.zeros((5, 2)))
    assert list(load_annotated_points(photo.path, photo, layout)) == ["chin"]
    template, ibug = annotation_notes(photo.path, layout)
    assert template.startswith("anna.tem is not used: expected 134 points (zhang134), 7 (dlib's 5")
    assert template.endswith(", found 2")
    assert ibug == "anna.pts is not used: expected iBUG's 68 points, found 5"


def test_a_damaged_delineation_is_no_other_kind(layout: FeatureLayout, photo: Photo) -> None:
    photo.path.with_suffix(".tem").write_text("2\n1 2\n3 x\n0\n")
    for read in (
        lambda: load_annotated_points(photo.path, photo, layout),
        lambda: annotation_notes(photo.path, layout),
    ):
        with pytest.raises(FileFormatError, match=r"anna\.tem: line 3: expected a finite number"):
            read()


def test_neighbours_follow_and_far_points_stay(layout: FeatureLayout, points: Array) -> None:
    corner = layout.index("right_mouth_corner")
    moved = np.array([6.0, -4.0])
    found = apply_annotations(layout, points, {"right_mouth_corner": points[corner] + moved})
    steps = (found - points) @ moved / (moved @ moved)
    assert steps[corner] == pytest.approx(1, abs=1e-12)
    assert steps[layout.index("right_inner_mouth_corner")] > 0.8
    assert abs(steps[layout.index("left_eye_outer")]) < 0.01
    assert steps.max() <= 1 + 1e-12
    assert steps.min() >= 0


def test_annotations_that_agree_move_all_points_alike(layout: FeatureLayout, points: Array) -> None:
    names = [name for name in layout.names if name != "chin"]
    annotated = {name: points[layout.index(name)] + [3, 1] for name in names}
    found = apply_annotations(layout, points, annotated)
    np.testing.assert_allclose(found - points, np.tile([3, 1], (len(points), 1)), atol=0.2)
