from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mien.errors import InputError
from mien.io.mesh.head_animation import HeadAnimation


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"times": []}, "times: expected at least one, got none"),
        ({"times": [0, 1, 1]}, "times: expected each later .* got 1 s after 1 s at index 2"),
        ({"times": [0, 2, 1]}, "times: expected each later .* got 1 s after 2 s at index 2"),
        ({"times": [9.0, 9.0 + 1e-9, 10]}, "times: expected each later"),
        ({"times": [-1, 0, 1]}, "times: expected seconds from 0 up, got -1"),
        ({"times": [0, np.nan, 1]}, "times: expected finite numbers"),
        ({"weights": np.zeros((2, 1))}, r"weights: expected shape \(3, 1\), got shape \(2, 1\)"),
        ({"target_names": ("a", "a")}, "target_names: expected each name once, got a more"),
        ({"rotations": np.zeros((3, 3, 3))}, r"rotations\[0\]: expected a rotation matrix"),
        ({"translations_mm": np.zeros((3, 2))}, "translations_mm: expected shape"),
    ],
)
def test_bad_animations_are_named(fields: dict[str, Any], message: str) -> None:
    good = {"times": [0.0, 1.0, 2.0], "target_names": ("jawOpen",), "weights": np.zeros((3, 1))}
    with pytest.raises(InputError, match=message):
        HeadAnimation(**(good | fields))


def test_weights_in_another_order_and_zero_where_none_are_given() -> None:
    animation = HeadAnimation([0.0, 1.0], ("b", "a"), [[1, 2], [3, 4]])
    np.testing.assert_array_equal(animation.weights_of(["a", "x", "b"]), [[2, 0, 1], [4, 0, 3]])
