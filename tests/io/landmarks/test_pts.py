"""iBUG's files and numbering."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mien.assets.feature_points import FeatureLayout, load_feature_layout
from mien.errors import FileFormatError, InputError
from mien.io.landmarks.pts import (
    IBUG_SHARED,
    load_pts,
    points_from_ibug,
    points_to_ibug,
    save_pts,
)

HEAD = "version: 1\nn_points:  2\n{\n"


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    return load_feature_layout()


def test_the_first_pixels_centre_is_half_a_pixel_in(tmp_path: Path) -> None:
    path = tmp_path / "a.pts"
    path.write_text(HEAD + "1 1\n10.5 20.25\n}\n")
    np.testing.assert_allclose(load_pts(path), [[0.5, 0.5], [10, 19.75]])


def test_what_is_written_round_trips(tmp_path: Path, rng: np.random.Generator) -> None:
    points = np.round(rng.uniform(-5, 900, (68, 2)), 3)
    save_pts(tmp_path / "a.pts", points)
    text = (tmp_path / "a.pts").read_text()
    assert text.startswith("version: 1\nn_points: 68\n{\n")
    np.testing.assert_allclose(load_pts(tmp_path / "a.pts"), points, atol=1e-9)


def test_shared_points_make_the_round_trip(layout: FeatureLayout, rng: np.random.Generator) -> None:
    points = layout.template * 300 + rng.normal(0, 2, layout.template.shape)
    named = points_from_ibug(points_to_ibug(layout, points), layout)
    assert set(named) == set(IBUG_SHARED.values())
    assert len(named) == 32
    for name, place in named.items():
        np.testing.assert_array_equal(place, points[layout.index(name)])


def test_the_68_points_of_a_symmetric_face_are_symmetric(layout: FeatureLayout) -> None:
    ibug = points_to_ibug(layout, layout.template)
    partner = np.arange(68)
    for first, last in ((0, 16), (17, 26), (31, 35), (48, 54), (60, 64)):
        partner[first : last + 1] = np.arange(last, first - 1, -1)
    partner[55:60], partner[65:68] = np.arange(59, 54, -1), np.arange(67, 64, -1)
    partner[36:48] = [45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40]
    np.testing.assert_allclose(ibug[partner], ibug * [-1, 1], atol=2e-5)
    assert (np.diff(ibug[:17, 0]) > 0).all()  # The jaw from the subject's right to left.
    assert (np.diff(ibug[27:31, 1]) > 0).all()
    assert ibug[37, 1] < ibug[41, 1]
    assert ibug[44, 1] < ibug[46, 1]
    assert (ibug[61:64, 1] < ibug[67:64:-1, 1]).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected an iBUG .pts file, found an empty file"),
        ("1 2\n3 4\n", "expected 'version: 1', 'n_points: 68' and the points"),
        (HEAD + "1 1\n2 2\n", "expected 'version: 1'"),
        (HEAD + "1 1\n}\n", "n_points says 2, found 1 points"),
        (HEAD + "1 1\n2 x\n}\n", r"line 5: expected a finite number \(y of a point\), found 'x'"),
        (HEAD + "1 1\n2 inf\n}\n", "line 5: expected a finite number"),
        (HEAD + "1 1\n2\n}\n", "ends before y of a point"),
        ("version: 1\nn_points: 0\n{\n}\n", "n_points says 0, found 0 points"),
    ],
)
def test_bad_files_raise(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "bad.pts"
    path.write_text(text)
    with pytest.raises(FileFormatError, match=message) as raised:
        load_pts(path)
    assert str(raised.value).startswith(str(path))


def test_bad_values_raise(tmp_path: Path, layout: FeatureLayout) -> None:
    with pytest.raises(InputError, match="points: expected finite"):
        save_pts(tmp_path / "a.pts", np.full((68, 2), np.inf))
    with pytest.raises(InputError, match=r"points: expected shape \(68, 2\)"):
        points_from_ibug(np.zeros((49, 2)), layout)
    with pytest.raises(InputError, match=r"points: expected shape \(134, 2\)"):
        points_to_ibug(layout, np.zeros((68, 2)))
    with pytest.raises(InputError, match="a readable file"):
        load_pts(tmp_path / "none.pts")


@pytest.mark.parametrize(
    "text",
    [
        "version: 1.0\r\nn_points: 2\r\n{\r\n1 1\r\n10.5 20.25\r\n}\r\n",
        "# of a database\nversion: 1.0 // the first\nn_points: 2\n{\n1 1 # chin\n\n10.5 20.25\n}",
        "\ufeffversion: 1.\nn_points:2\n{ 1 1\n10.5 20.25 }",
    ],
)
def test_files_of_other_programs_read(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.pts").write_bytes(text.encode())
    np.testing.assert_allclose(load_pts(tmp_path / "a.pts"), [[0.5, 0.5], [10, 19.75]])


@pytest.mark.parametrize("version", ["2", "1.1", "10", "1.0.0"])
def test_other_versions_raise(tmp_path: Path, version: str) -> None:
    (tmp_path / "a.pts").write_text(HEAD.replace("1", version) + "1 1\n2 2\n}\n")
    with pytest.raises(FileFormatError, match="expected 'version: 1', 'n_points: 68' and"):
        load_pts(tmp_path / "a.pts")
