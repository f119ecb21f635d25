"""Points that were marked by hand beside a photo."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from mien.app.demo import demo_photos
from mien.app.example_marks import read_marks, with_marks
from mien.assets.feature_points import load_feature_layout
from mien.capture.photos import load_photo
from mien.errors import FileFormatError
from mien.formats.points_json import write_points_json
from mien.formats.pts import points_to_ibug, write_pts
from mien.formats.tem import points_to_tem, write_tem

LAYOUT = load_feature_layout()


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A photo of 200x300 px without marks."""
    Image.fromarray(np.zeros((300, 200, 3), np.uint8)).save(tmp_path / "a.png")
    return tmp_path / "a.png"


@pytest.fixture
def points() -> Any:
    """All points somewhere in it."""
    return np.round(np.random.default_rng(2).uniform(10, 190, (len(LAYOUT.names), 2)), 3)


def annotated(photo: Path, data: dict[str, Any]) -> Path:
    """The file of annotations of a photo."""
    path = photo.parent / "annotations" / f"{photo.stem}.json"
    path.parent.mkdir()
    path.write_text(json.dumps(data))
    return path


def test_a_photo_without_marks(photo: Path) -> None:
    assert read_marks(photo, load_photo(photo), LAYOUT) == {}


def test_marks_follow_a_photo_that_is_reduced(photo: Path, points: Any) -> None:
    half = load_photo(photo, max_side=150)
    write_tem(photo.with_suffix(".tem"), points_to_tem(LAYOUT, points))
    marks = read_marks(photo, half, LAYOUT)
    assert set(marks) == set(LAYOUT.names)
    np.testing.assert_allclose(marks["menton"], points[LAYOUT.index("menton")] / 2)
    annotated(photo, {"layout": LAYOUT.name, "points": {"menton": [50, 60]}})
    marks = read_marks(photo, half, LAYOUT)
    np.testing.assert_allclose(marks["menton"], [25, 30])
    np.testing.assert_allclose(marks["nose_tip"], points[LAYOUT.index("nose_tip")] / 2)


def test_pts_files_count_more_than_tem_files(photo: Path, points: Any) -> None:
    write_tem(photo.with_suffix(".tem"), points_to_tem(LAYOUT, points + 3))
    write_pts(photo.with_suffix(".pts"), points_to_ibug(LAYOUT, points))
    marks = read_marks(photo, load_photo(photo), LAYOUT)
    np.testing.assert_allclose(marks["nose_tip"], points[LAYOUT.index("nose_tip")], atol=1e-3)
    np.testing.assert_allclose(marks["hairline"], points[LAYOUT.index("hairline")] + 3)


def test_all_points_of_a_layout_can_be_annotated(photo: Path, points: Any) -> None:
    (photo.parent / "annotations").mkdir()
    named = dict(zip(LAYOUT.names, points, strict=True))
    write_points_json(photo.parent / "annotations" / "a.json", LAYOUT, named)
    marks = read_marks(photo, load_photo(photo), LAYOUT)
    assert all((marks[name] == named[name]).all() for name in LAYOUT.names)


def test_marks_for_a_head_give_the_points_that_mean_the_same(photo: Path) -> None:
    """`left_jaw.2` is near the ear on the head's line, near the chin among the feature points."""
    marks = {"nose_tip": [90, 100], "left_jaw.2": [150, 200], "right_ear_lobe": [20, 120]}
    annotated(photo, {"photo": "a.png", "size": [200, 300], "points": marks})
    found = read_marks(photo, load_photo(photo), LAYOUT)
    assert {name: place.tolist() for name, place in found.items()} == {"nose_tip": [90, 100]}


def test_the_marks_of_the_photos_that_ship_are_no_obstacle() -> None:
    path = demo_photos() / "photo_left.png"
    assert "nose_tip" in read_marks(path, load_photo(path), LAYOUT)


def test_broken_marks_are_refused_with_their_place(photo: Path) -> None:
    path = annotated(photo, {"layout": LAYOUT.name, "points": {"nose_tipp": [1, 2]}})
    with pytest.raises(FileFormatError, match=r"points.nose_tipp: unknown point"):
        read_marks(photo, load_photo(photo), LAYOUT)
    path.write_text(json.dumps({"points": {"nose_tipp": [1, 2]}}))
    with pytest.raises(FileFormatError, match=r"points.nose_tipp: unknown name"):
        read_marks(photo, load_photo(photo), LAYOUT)


def test_marked_points_are_there_and_their_neighbours_follow(points: Any) -> None:
    spread = (LAYOUT.template - LAYOUT.template.mean(0)) * 100
    tip = LAYOUT.index("nose_tip")
    moved = with_marks(LAYOUT, spread, {"nose_tip": spread[tip] + [3, -2]})
    shift = moved - spread
    np.testing.assert_allclose(shift[tip], [3, -2])
    assert 0 < shift[LAYOUT.index("nose_base"), 0] < 3
    np.testing.assert_allclose(shift[LAYOUT.index("right_temple")], 0, atol=0.05)
    assert with_marks(LAYOUT, points, {}) is points
