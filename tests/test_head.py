from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mien.camera import Camera
from mien.errors import InputError
from mien.head import Expression, FittedView, Head
from mien.mesh import Mesh

VERTICES = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]])
CAMERA = Camera(64, 48, 100.0, np.eye(3), np.array([0.0, 0, 500]))


def make_head(**changes: Any) -> Head:
    views = (FittedView("front.jpg", CAMERA, 0.5, 13), FittedView("side.jpg", CAMERA, 0.7, 11))
    whole = {
        "subject": "Ada",
        "mesh": Mesh(VERTICES, np.array([[0, 1, 2]])),
        "expressions": {
            "neutral": Expression(VERTICES, views),
            "joy": Expression(VERTICES + 1, (FittedView("joy/front.jpg", CAMERA, 0.9, 13),)),
        },
        "uncertainty_mm": np.ones(3),
        "unit_names": ("jawOpen",),
        "unit_offsets": np.ones((1, 3, 3)),
        "textures": {"atlas": np.zeros((4, 4, 3), np.uint8)},
    }
    return Head(**(whole | changes))


def test_views_are_found_by_photo() -> None:
    head = make_head()
    assert [view.photo for view in head.views] == ["front.jpg", "side.jpg", "joy/front.jpg"]
    assert head.view("side.jpg").rms_px == 0.7
    with pytest.raises(InputError, match=r"photo: expected one of .*front\.jpg, side.* got x\.jpg"):
        head.view("x.jpg")


def test_an_expression_is_a_mesh_of_the_same_topology() -> None:
    mesh = make_head().expression_mesh("joy")
    np.testing.assert_array_equal(mesh.vertices, VERTICES + 1)
    np.testing.assert_array_equal(mesh.triangles, [[0, 1, 2]])
    with pytest.raises(InputError, match="expression: expected one of neutral, joy, got awe"):
        make_head().expression_mesh("awe")


def test_a_head_is_frozen_all_through() -> None:
    head = make_head()
    arrays = (
        head.units,
        head.uncertainty_mm,
        head.textures["atlas"],
        head.expressions["joy"].vertices,
    )
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_without_units_there_are_none() -> None:
    assert make_head(unit_names=(), unit_offsets=None).units.shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"expressions": {"joy": Expression(VERTICES)}}, "expected one called neutral, got joy"),
        ({"expressions": {}}, "expected one called neutral, got none"),
        (
            {"expressions": {"neutral": Expression(VERTICES + 1)}},
            "mesh: expected the vertices of the neutral expression",
        ),
        (
            {"expressions": {"neutral": Expression(VERTICES), "joy": Expression(VERTICES[:2])}},
            r"expression joy: expected shape \(3, 3\), got shape \(2, 3\)",
        ),
        ({"uncertainty_mm": np.ones(2)}, "uncertainty_mm: expected shape"),
        ({"uncertainty_mm": np.array([1, np.nan, 1])}, "uncertainty_mm: expected finite numbers"),
        ({"unit_names": ("a", "b")}, r"unit_offsets: expected shape \(2, 3, 3\)"),
        ({"textures": {"atlas": np.zeros((4, 4))}}, r"texture atlas: expected an \(h, w, 3\)"),
    ],
)
def test_what_does_not_fit_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make_head(**changes)


@pytest.mark.parametrize("name", ["", "..", "a/b", "a\\b", ".x", "a\nb", "a:b"])
def test_names_must_serve_as_file_names(name: str) -> None:
    with pytest.raises(InputError, match="names that can be file names"):
        make_head(textures={name: np.zeros((4, 4, 3), np.uint8)})
    expressions = make_head().expressions | {name: Expression(VERTICES)}
    with pytest.raises(InputError, match="names that can be file names"):
        make_head(expressions=expressions)


def test_a_view_has_a_finite_error_and_a_count() -> None:
    view = FittedView("front.jpg", CAMERA, 0.5, 13)
    for bad in (-1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="rms_px: expected a number from 0 up"):
            replace(view, rms_px=bad)
    with pytest.raises(InputError, match="points_used: expected a count from 0 up"):
        replace(view, points_used=-1)
