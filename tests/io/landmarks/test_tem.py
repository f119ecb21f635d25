"""Delineations: written and read back, and what they share with the feature points."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mien.assets.feature_points import load_feature_layout
from mien.errors import FileFormatError, InputError, OtherPointsError
from mien.io.landmarks.pts import points_to_ibug
from mien.io.landmarks.tem import (
    Delineation,
    TemLine,
    load_tem,
    points_from_tem,
    points_to_tem,
    save_tem,
)
from mien.io.landmarks.tem_templates import TEMPLATES

SMALL = "3\n1.5\t2\n3 4\n5\t6\n2\n0\n2\n0 1\n1\n4\n0 1 2 0\n"


def test_reads_points_and_lines(tmp_path: Path) -> None:
    path = tmp_path / "a.tem"
    path.write_text(SMALL)
    found = load_tem(path)
    np.testing.assert_array_equal(found.points, [[1.5, 2], [3, 4], [5, 6]])
    assert [(line.closed, line.points.tolist()) for line in found.lines] == [
        (False, [0, 1]),
        (True, [0, 1, 2, 0]),
    ]


def test_a_file_without_lines_and_with_other_ends_of_line_reads(tmp_path: Path) -> None:
    (tmp_path / "a.tem").write_bytes(b"\xef\xbb\xbf1\r\n7\t8\r\n")
    found = load_tem(tmp_path / "a.tem")
    np.testing.assert_array_equal(found.points, [[7, 8]])
    assert found.lines == ()


def test_a_layouts_points_round_trip(tmp_path: Path, rng: np.random.Generator) -> None:
    layout = load_feature_layout()
    points = np.round(rng.uniform(0, 900, (134, 2)), 3)
    save_tem(tmp_path / "a.tem", points_to_tem(layout, points))
    found = load_tem(tmp_path / "a.tem")
    named = points_from_tem(found, layout)
    assert list(named) == list(layout.names)
    np.testing.assert_allclose(np.array(list(named.values())), points, atol=1e-9)
    lines = [[layout.names[i] for i in line.points] for line in found.lines]
    assert ["right_lid_fold.0", "right_lid_fold.1", "right_lid_fold.2"] in lines


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected a .tem delineation, found an empty file"),
        ("x\n", r"line 1: expected a finite number \(number of points\), found 'x'"),
        ("0\n", "line 1: expected number of points, a whole number from 1"),
        ("1e9\n", "line 1: expected number of points, a whole number from 1 to 99999"),
        ("2\n1 2\n3\n", "ends before a point"),
        ("1\n1 nan\n0\n", r"line 2: expected a finite number \(a point\), found 'nan'"),
        (SMALL.replace("0 1\n", "0 3\n"), "line 8: expected a line's point, .* 0 to 2, found '3'"),
        (SMALL.replace("1\n4", "2\n4"), "line 9: expected a line: 0 for open or 1 for closed"),
        (SMALL + "9\n", "line 12: expected the end, found '9'"),
        ("3\n1 2\n3 4\n5 6\n1\n0\n2\n0\n", "ends before a line's point"),
    ],
)
def test_bad_files_raise(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.tem"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message) as raised:
        load_tem(path)
    assert str(raised.value).startswith(str(path))


def test_other_bytes_and_no_file_raise(tmp_path: Path) -> None:
    (tmp_path / "bad.tem").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="found other bytes"):
        load_tem(tmp_path / "bad.tem")
    with pytest.raises(InputError, match="a readable file"):
        load_tem(tmp_path / "none.tem")


def test_bad_values_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / "a.tem"
    with pytest.raises(InputError, match="points: expected finite"):
        save_tem(path, Delineation(np.full((2, 2), np.nan), ()))
    with pytest.raises(InputError, match="lines: expected points from 0 to 1"):
        save_tem(path, Delineation(np.zeros((2, 2)), (TemLine(False, np.array([0, 2])),)))
    assert not path.exists()


def test_another_template_raises() -> None:
    delineation = Delineation(np.zeros((71, 2)), ())
    with pytest.raises(OtherPointsError) as raised:
        points_from_tem(delineation, load_feature_layout(), "a.tem")
    assert str(raised.value) == (
        "a.tem: expected 134 points (zhang134), 7 (dlib's 5 and the middles of the eyes), "
        "70 (pupils and iBUG's 68), 83 (Face++), 106 (Face++), 189 (Face Research Lab), found 71"
    )


@pytest.mark.parametrize("count", TEMPLATES)
def test_templates_name_points_of_the_layout_on_both_sides(count: int) -> None:
    layout, shared = load_feature_layout(), TEMPLATES[count].shared
    assert len(set(shared.values())) == len(shared)
    assert 0 <= min(shared.values()) <= max(shared.values()) < count
    assert {layout.names[layout.mirror[layout.index(name)]] for name in shared} == set(shared)


@pytest.mark.parametrize(
    "name", ["london/001_03", "lisa/15cm", "lisa/45cm", "lisa/lisa1", "lisa/lisa4"]
)
def test_real_templates_lie_where_their_names_say(shared: Path, name: str) -> None:
    layout = load_feature_layout()
    named = points_from_tem(load_tem(shared / "data" / f"{name}.tem"), layout)
    width = named["left_eye_outer"][0] - named["right_eye_outer"][0]
    assert width > 0
    for side in ("right", "left"):
        inner, outer = named[f"{side}_eye_inner"], named[f"{side}_eye_outer"]
        assert np.linalg.norm(named[f"{side}_pupil"] - (inner + outer) / 2) < 0.06 * width
    # An affine map of the template explains them to a few per cent; its mouth is open.
    still = [name for name in named if not re.search("lip|mouth|menton", name)]
    places = layout.template[[layout.index(name) for name in still]]
    marked = np.array([named[name] for name in still])
    design = np.column_stack([places, np.ones(len(places))])
    fitted = design @ np.linalg.lstsq(design, marked, rcond=None)[0]
    assert np.abs(fitted - marked).max() < 0.06 * width
    assert named["upper_lip_inner"][1] <= named["lower_lip_inner"][1]


def test_pupils_and_ibugs_points(rng: np.random.Generator) -> None:
    """As webmorphR.dlib writes them: two for the eyes, the image's left one first, then the 68."""
    layout = load_feature_layout()
    points = layout.template * 300 + rng.normal(0, 2, layout.template.shape)
    pupils = [points[layout.index(f"{side}_pupil")] for side in ("right", "left")]
    found = points_from_tem(
        Delineation(np.vstack([pupils, points_to_ibug(layout, points)]), ()), layout
    )
    assert len(found) == 34
    for name, place in found.items():
        np.testing.assert_array_equal(place, points[layout.index(name)])


def test_dlibs_five_points() -> None:
    """dlib counts the eye on the image's right first, from its outer corner in."""
    layout = load_feature_layout()
    eyes = [(-20, 0), (20, 1), (30, 1), (10, 1), (-30, 0), (-10, 0), (0, 40)]
    found = points_from_tem(Delineation(np.array(eyes, float), ()), layout)
    assert {name: tuple(place) for name, place in found.items()} == {
        "left_eye_outer": (30, 1),
        "left_eye_inner": (10, 1),
        "right_eye_outer": (-30, 0),
        "right_eye_inner": (-10, 0),
        "nose_base": (0, 40),
    }


def test_the_70_points_of_the_case_are_a_face(shared: Path) -> None:
    layout = load_feature_layout()
    path = shared / "data" / "cases" / "dlib70_tem" / "dlib70.tem"
    found = points_from_tem(load_tem(path), layout, path)
    assert found["right_pupil"][0] < found["nose_tip"][0] < found["left_pupil"][0]
    assert found["nose_tip"][1] < found["upper_lip_outer"][1] < found["menton"][1]
    for side in ("right", "left"):
        corners = [found[f"{side}_eye_{end}"] for end in ("inner", "outer")]
        assert np.linalg.norm(found[f"{side}_pupil"] - np.mean(corners, axis=0)) < 8
