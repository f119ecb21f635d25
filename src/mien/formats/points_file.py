"""Feature points from a file of any kind that holds them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int
from mien.assets.feature_points import FeatureLayout
from mien.errors import FileFormatError, InputError
from mien.formats.points_json import read_points_json
from mien.formats.pts import IBUG_COUNT, points_from_ibug, read_pts
from mien.formats.tem import points_from_tem, read_tem

__all__ = ["read_points"]

Named = dict[str, Float[Array, " 2"]]


def read_points(
    path: str | Path, layout: FeatureLayout
) -> tuple[Int[Array, " k"], Float[Array, "k 2"]]:
    """Indices of the points that a file holds, in rising order, and where they are, px.

    Args:
        path: `.json`, as `read_points_json` has it; `.tem` of Psychomorph or WebMorph; `.pts` of
            iBUG's 68 points. Of the last two, those that the layout shares are taken.
    Raises: InputError: another ending, a file that cannot be read. FileFormatError: not what its
        ending says; another layout or template; says where.
    """
    path = Path(path)
    read = _READERS.get(path.suffix.lower())
    if read is None:
        expected = f"a name that ends in {', '.join(_READERS)}"
        raise InputError(path, expected, path.suffix or "no suffix")
    named = sorted((layout.index(name), place) for name, place in read(path, layout).items())
    return np.array([index for index, _ in named]), np.array([place for _, place in named])


def _from_tem(path: Path, layout: FeatureLayout) -> Named:
    return points_from_tem(read_tem(path), layout, path)


def _from_pts(path: Path, layout: FeatureLayout) -> Named:
    points = read_pts(path)
    if len(points) != IBUG_COUNT:
        raise FileFormatError(path, f"expected iBUG's {IBUG_COUNT} points, found {len(points)}")
    return points_from_ibug(points, layout)


_READERS: dict[str, Callable[[Path, FeatureLayout], Named]] = {
    ".json": read_points_json,
    ".tem": _from_tem,
    ".pts": _from_pts,
}
