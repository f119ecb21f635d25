"""Feature points from and to files of several kinds; the suffix tells which."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float, Int, check_array
from mien.assets.feature_points import FeatureLayout
from mien.errors import InputError, OtherPointsError
from mien.io.landmarks.points_json import load_points_json, save_points_json
from mien.io.landmarks.pts import IBUG_COUNT, load_pts, points_from_ibug, points_to_ibug, save_pts
from mien.io.landmarks.tem import load_tem, points_from_tem, points_to_tem, save_tem

__all__ = ["check_points_kind", "load_feature_points", "save_feature_points"]

NamedPoints = dict[str, Float[Array, " 2"]]


def load_feature_points(
    path: str | Path, layout: FeatureLayout
) -> tuple[Int[Array, " k"], Float[Array, "k 2"]]:
    """Indices of the points in a file, (K,) ascending, and their positions, (K, 2) px.

    Args:
        path: `.json`, as `load_points_json` has it; `.tem` of Psychomorph or WebMorph; `.pts` of
            iBUG's 68 points. Of the last two, those that are in the layout, too, are taken.
        layout: of the points.

    Raises:
        InputError: another suffix, a file that cannot be read.
        FileFormatError: not what its suffix says, another layout; says where.
        OtherPointsError: another template.
    """
    path = Path(path)
    load = _LOADERS[check_points_kind(path)]
    found = sorted((layout.index(name), point) for name, point in load(path, layout).items())
    return np.array([index for index, _ in found]), np.array([point for _, point in found])


def check_points_kind(path: str | Path) -> str:
    """The suffix of a file of points. Raises: InputError: an unknown one."""
    kind = Path(path).suffix.lower()
    if kind not in _LOADERS:
        raise InputError(path, f"a name that ends in {', '.join(_LOADERS)}", kind or "no suffix")
    return kind


def save_feature_points(
    path: str | Path, layout: FeatureLayout, points: Float[Array, "n 2"]
) -> None:
    """Write all points of a layout; the suffix tells the kind of file.

    Args:
        path: `.json`, by name; `.tem`, in the layout's order; `.pts`, iBUG's 68.
        layout: of the points.
        points: (n, 2) px.

    Raises:
        InputError: another suffix, shape, NaN, a place that cannot be written.
    """
    path = Path(path)
    _SAVERS[check_points_kind(path)](
        path, layout, check_array("points", points, (len(layout.names), 2))
    )


def _to_json(path: Path, layout: FeatureLayout, points: Float[Array, "n 2"]) -> None:
    save_points_json(path, layout, dict(zip(layout.names, points, strict=True)))


def _to_tem(path: Path, layout: FeatureLayout, points: Float[Array, "n 2"]) -> None:
    save_tem(path, points_to_tem(layout, points))


def _to_pts(path: Path, layout: FeatureLayout, points: Float[Array, "n 2"]) -> None:
    save_pts(path, points_to_ibug(layout, points))


def _from_tem(path: Path, layout: FeatureLayout) -> NamedPoints:
    return points_from_tem(load_tem(path), layout, path)


def _from_pts(path: Path, layout: FeatureLayout) -> NamedPoints:
    points = load_pts(path)
    if len(points) != IBUG_COUNT:
        raise OtherPointsError(path, f"expected iBUG's {IBUG_COUNT} points, found {len(points)}")
    return points_from_ibug(points, layout)


_LOADERS: dict[str, Callable[[Path, FeatureLayout], NamedPoints]] = {
    ".json": load_points_json,
    ".tem": _from_tem,
    ".pts": _from_pts,
}
_SAVERS: dict[str, Callable[[Path, FeatureLayout, Float[Array, "n 2"]], None]] = {
    ".json": _to_json,
    ".tem": _to_tem,
    ".pts": _to_pts,
}
