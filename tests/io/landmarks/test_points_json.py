"""P.json and the other files of points: written, read back, and refused with their place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.errors import FileFormatError, InputError
from mien.io.landmarks.points_file import load_feature_points, save_feature_points
from mien.io.landmarks.points_json import load_points_json, save_points_json
from mien.io.landmarks.pts import save_pts


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


def test_points_round_trip(tmp_path: Path, layout: FeatureLayout) -> None:
    path = tmp_path / "P.json"
    given = {"menton": np.array([10.25, 300.5]), "nose_tip": np.array([-1.0, 7.0])}
    save_points_json(path, layout, given)
    assert json.loads(path.read_text()) == {
        "layout": layout.name,
        "points": {"menton": [10.25, 300.5], "nose_tip": [-1, 7]},
    }
    found = load_points_json(path, layout)
    assert {name: point.tolist() for name, point in found.items()} == {
        "menton": [10.25, 300.5],
        "nose_tip": [-1, 7],
    }


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"points": {"menton": [1, 2]}}, "layout: missing"),
        (
            {"layout": "ibug68", "points": {"menton": [1, 2]}},
            "layout: expected 'zhang134', found 'ibug68'",
        ),
        ({"layout": "zhang134"}, "points: missing"),
        ({"layout": "zhang134", "points": {}}, "points: expected at least one point, found none"),
        ({"layout": "zhang134", "points": [[1, 2]]}, "points: expected an object, found a list"),
        (
            {"layout": "zhang134", "points": {"nose_tipp": [1, 2]}},
            r"points.nose_tipp: unknown point 'nose_tipp'; did you mean nose_tip",
        ),
        (
            {"layout": "zhang134", "points": {"menton": [1, 2, 3]}},
            "points.menton: expected x and y, found 3 numbers",
        ),
        (
            {"layout": "zhang134", "points": {"menton": [1, None]}},
            "points.menton: expected a number, found null",
        ),
        (
            {"layout": "zhang134", "points": {"menton": [1, float("nan")]}},
            "points.menton: expected a finite number, found nan",
        ),
        (
            {"layout": "zhang134", "points": {"menton": [float("inf"), 1]}},
            "points.menton: expected a finite number, found inf",
        ),
        (
            {"layout": "zhang134", "points": {"menton": [1, 2]}, "photo": "a.png"},
            "photo: unknown key 'photo'; expected one of layout, points",
        ),
    ],
)
def test_what_is_refused(
    tmp_path: Path, layout: FeatureLayout, document: object, message: str
) -> None:
    path = tmp_path / "P.json"
    path.write_text(json.dumps(document))
    with pytest.raises(FileFormatError, match=message) as caught:
        load_points_json(path, layout)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_what_is_not_written(tmp_path: Path, layout: FeatureLayout) -> None:
    path = tmp_path / "P.json"
    with pytest.raises(InputError, match="such as nose_tip"):
        save_points_json(path, layout, {"nose_tipp": np.zeros(2)})
    with pytest.raises(InputError, match="menton: expected finite numbers"):
        save_points_json(path, layout, {"menton": np.array([0, np.nan])})
    with pytest.raises(InputError, match="points: expected at least one, got none"):
        save_points_json(path, layout, {})
    assert not path.exists()


def test_files_of_all_kinds(
    tmp_path: Path, layout: FeatureLayout, rng: np.random.Generator
) -> None:
    points = np.round(rng.uniform(0, 500, (len(layout.names), 2)), 3)
    for name in ("a.json", "a.tem", "a.PTS"):
        save_feature_points(tmp_path / name, layout, points)
    for name, count in (("a.json", len(points)), ("a.tem", len(points)), ("a.PTS", 27)):
        known, positions = load_feature_points(tmp_path / name, layout)
        assert len(known) == len(positions) >= count
        assert (np.diff(known) > 0).all()
        np.testing.assert_allclose(positions, points[known], atol=1e-3)


def test_files_of_other_kinds(tmp_path: Path, layout: FeatureLayout) -> None:
    with pytest.raises(InputError, match=r"a.txt: expected a name that ends in .json, .tem, .pts"):
        load_feature_points(tmp_path / "a.txt", layout)
    with pytest.raises(InputError, match=r"a.png: expected a name that ends in .json, .tem, .pts"):
        save_feature_points(tmp_path / "a.png", layout, np.zeros((len(layout.names), 2)))
    with pytest.raises(InputError, match=r"none.json: expected a readable file"):
        load_feature_points(tmp_path / "none.json", layout)
    save_pts(tmp_path / "a.pts", np.zeros((5, 2)))
    with pytest.raises(FileFormatError, match="expected iBUG's 68 points, found 5"):
        load_feature_points(tmp_path / "a.pts", layout)
    (tmp_path / "a.tem").write_text("2\n1 2\n3 4\n")
    with pytest.raises(FileFormatError, match=r"expected 134 points \(zhang134\), 7 "):
        load_feature_points(tmp_path / "a.tem", layout)


def test_points_in_space(tmp_path: Path, layout: FeatureLayout) -> None:
    path = tmp_path / "P.json"
    save_points_json(path, layout, {"menton": np.array([1.0, -120.5, 20.25])})
    found = load_points_json(path, layout, axes=3)
    assert found["menton"].tolist() == [1, -120.5, 20.25]
    with pytest.raises(FileFormatError, match=r"points\.menton: expected x and y, found 3 numbers"):
        load_points_json(path, layout)
    with pytest.raises(InputError, match="two numbers for each, or three"):
        save_points_json(path, layout, {"menton": np.zeros(3), "nose_tip": np.zeros(2)})
