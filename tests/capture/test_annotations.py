from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mien.capture.annotations import (
    AnnotationNames,
    Annotations,
    load_annotations,
    save_annotations,
)
from mien.capture.images.photos import Photo
from mien.errors import FileFormatError, InputError

NAMES = AnnotationNames(frozenset({"nose_tip", "chin", "left_jaw.3"}), frozenset({"left_jaw"}))


@pytest.fixture
def photo() -> Photo:
    """100 x 50 px, reduced from 200 x 100."""
    pixels = np.zeros((50, 100, 3), np.uint8)
    return Photo("a.png", Path("a.png"), pixels, original_size=(200, 100))


@pytest.fixture
def load(tmp_path: Path, photo: Photo) -> Callable[[Any], Annotations]:
    def load(data: Any) -> Annotations:
        text = data if isinstance(data, str) else json.dumps(data)
        (tmp_path / "a.json").write_text(text)
        return load_annotations(tmp_path / "a.json", photo, names=NAMES)

    return load


def test_marks_follow_the_photo_when_it_is_reduced(load: Callable[[Any], Annotations]) -> None:
    marks = {
        "points": {"nose_tip": [100, 40], "left_jaw.3": [0, 100]},
        "curves": {"left_jaw": [[0, 0], [200, 90.5]]},
    }
    for size in ({}, {"size": [200, 100]}):
        found = load({"photo": "a.png", **size, **marks})
        np.testing.assert_allclose(found.points["nose_tip"], [50, 20])
        np.testing.assert_allclose(found.points["left_jaw.3"], [0, 50])
        np.testing.assert_allclose(found.curves["left_jaw"], [[0, 0], [100, 45.25]])
        assert not found.notes


def test_marks_made_at_the_reduced_size(load: Callable[[Any], Annotations]) -> None:
    found = load({"size": [100, 50], "points": {"chin": [10, 20]}})
    np.testing.assert_allclose(found.points["chin"], [10, 20])
    assert not found.notes


def test_marks_made_at_another_size(load: Callable[[Any], Annotations]) -> None:
    found = load({"size": [400, 200], "points": {"chin": [400, 20]}})
    np.testing.assert_allclose(found.points["chin"], [100, 5])
    assert found.notes == ("marks made at 400x200 are scaled to 200x100",)


def test_empty_file_has_no_marks(load: Callable[[Any], Annotations]) -> None:
    assert not load({})


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", "line 1, column 2: expected JSON"),
        ("[]", "expected an object, found a list"),
        ("[" * 100_000, "lists and objects at most 64 deep"),
        ({"point": {}}, "point: unknown key; did you mean points?"),
        ({"points": []}, "points: expected an object, found a list"),
        (
            {"points": {"nosetip": [1, 2]}},
            r"points\.nosetip: unknown name; did you mean nose_tip\?",
        ),
        ({"points": {"left_jaw.9": [1, 2]}}, r"unknown name; did you mean left_jaw\.3\?"),
        ({"curves": {"xyz": [[1, 2]]}}, r"curves\.xyz: unknown name; known are left_jaw"),
        (
            '{"points": {"chin": [NaN, 2]}}',
            r"points\.chin: expected finite numbers, found \[NaN, 2\]",
        ),
        ('{"points": {"chin": [1e999, 2]}}', r"points\.chin: expected finite numbers"),
        ({"points": {"chin": [1, 2, 3]}}, r"points\.chin: expected \[x, y\] in px"),
        ({"points": {"chin": ["1", 2]}}, r"points\.chin: expected \[x, y\] in px"),
        ({"points": {"chin": [True, 2]}}, r"points\.chin: expected \[x, y\] in px"),
        ({"points": {"chin": None}}, r"points\.chin: expected \[x, y\] in px, found null"),
        (
            {"points": {"chin": [200.1, 2]}},
            r"points\.chin: expected a place within the photo's 200x100 px",
        ),
        ({"points": {"chin": [5, -0.1]}}, "expected a place within the photo"),
        (
            {"curves": {"left_jaw": [[1, 2]]}},
            r"curves\.left_jaw: expected two points or more, found 1",
        ),
        ({"curves": {"left_jaw": []}}, "expected two points or more, found 0"),
        ({"curves": {"left_jaw": "round"}}, "expected two points or more, found text"),
        ({"curves": {"left_jaw": [[1, 2], [1, 2]]}}, "found one place repeated"),
        ({"curves": {"left_jaw": [[1, 2], [1]]}}, r"curves\.left_jaw: expected \[x, y\]"),
        ('{"points": {"chin": [1, 2], "chin": [3, 4]}}', "chin: the name appears twice"),
        (
            {"size": [100, 200]},
            "size: expected 200x100, the size of a.png, or a multiple; found 100x200",
        ),
        ({"size": [0, 0]}, r"size: expected \[width, height\] in px"),
        ({"size": 200}, r"size: expected \[width, height\] in px"),
    ],
)
def test_bad_files(load: Callable[[Any], Annotations], data: Any, message: str) -> None:
    with pytest.raises(FileFormatError, match=message) as caught:
        load(data)
    assert "a.json: " in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unreadable(tmp_path: Path, photo: Photo) -> None:
    with pytest.raises(InputError, match=r"b\.json: expected a readable file"):
        load_annotations(tmp_path / "b.json", photo, names=NAMES)
    (tmp_path / "b.json").write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match="expected JSON in UTF-8"):
        load_annotations(tmp_path / "b.json", photo, names=NAMES)


def test_saved_marks_come_back(tmp_path: Path, photo: Photo) -> None:
    path = tmp_path / "annotations" / "a.json"
    points = {"chin": np.array([10.1234, 20.0])}
    curves = {"left_jaw": np.array([[1.5, 2.0], [3.0, 4.25], [5.0, 6.0]])}
    save_annotations(path, photo, Annotations(points, curves))
    found = load_annotations(path, photo, names=NAMES)
    np.testing.assert_allclose(found.points["chin"], [10.123, 20.0])
    np.testing.assert_array_equal(found.curves["left_jaw"], curves["left_jaw"])
    assert not found.notes
    assert [item.name for item in path.parent.iterdir()] == ["a.json"]


def test_failed_save_keeps_the_old_file(
    tmp_path: Path, photo: Photo, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.json").write_text("old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(InputError, match=r"a\.json: expected a place to write to, got No space"):
        save_annotations(tmp_path / "a.json", photo, Annotations())
    assert [(item.name, item.read_text()) for item in tmp_path.iterdir()] == [("a.json", "old")]


def test_names_of_a_head() -> None:
    head = SimpleNamespace(points={"chin": 4}, polylines={"left_jaw": (7, 8)})
    names = AnnotationNames.of(head)  # type: ignore[arg-type]
    assert names.points == {"chin", "left_jaw.0", "left_jaw.1"}
    assert names.curves == {"left_jaw"}
