"""Points that a person marked by hand on the photos that become examples."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.assets.feature_points import FeatureLayout
from mien.capture.annotations import AnnotationNames, load_annotations
from mien.capture.face_series import FaceSeries
from mien.capture.folder import ANNOTATIONS
from mien.capture.photos import Photo
from mien.errors import FileFormatError
from mien.formats.pts import IBUG_COUNT, points_from_ibug, read_pts
from mien.formats.tem import points_from_tem, read_tem

__all__ = ["read_marks", "with_marks"]

REACH = 0.12
"""Points this near to a marked one, in widths of the face, follow it by 0.6 of its way."""

Marks = Mapping[str, Float[Array, " 2"]]


def read_marks(file: Path, photo: Photo, layout: FeatureLayout) -> dict[str, Array]:
    """Hand-made marks beside a photo, by point, in px of the photo as loaded.

    Looked for in `STEM.tem` and `STEM.pts` beside it and in `annotations/STEM.json`; where two mark
    the same point, the later one of these counts.

    Raises: FileFormatError: one of them is damaged or holds other points; says where.
    """
    found: dict[str, Array] = {}
    tem, pts = file.with_suffix(".tem"), file.with_suffix(".pts")
    if tem.is_file():
        marks = points_from_tem(read_tem(tem), layout, tem)
        found |= {name: place * photo.scale for name, place in marks.items()}
    if pts.is_file():
        points = read_pts(pts)
        if len(points) != IBUG_COUNT:
            raise FileFormatError(pts, f"expected {IBUG_COUNT} points, found {len(points)}")
        found |= {n: place * photo.scale for n, place in points_from_ibug(points, layout).items()}
    annotations = file.parent / ANNOTATIONS / f"{file.stem}.json"
    if annotations.is_file():
        names = AnnotationNames(frozenset(layout.names), frozenset())
        found |= load_annotations(annotations, photo, names=names).points
    return found


def with_marks(
    layout: FeatureLayout, points: Float[Array, "n 2"], marks: Marks
) -> Float[Array, "n 2"]:
    """Detected points with marked ones in their places; neighbours follow, less the farther."""
    if not marks:
        return points
    rows = [layout.index(name) for name in marks]
    moved = np.stack(list(marks.values())) - points[rows]
    reach = REACH * float(np.ptp(points[:, 0]))
    apart = np.linalg.norm(points[:, None] - points[rows], axis=2) / reach
    pull = np.exp(-(apart**2) / 2)
    result: Array = points + pull @ moved / np.maximum(pull.sum(axis=1), 1)[:, None]
    result[rows] = points[rows] + moved
    return result


def points_of(
    series: FaceSeries, layout: FeatureLayout, marks: Mapping[int, Marks]
) -> Float[Array, "N n 2"]:
    """Feature points in all pictures of a series; marks by row win."""
    points: Array = np.einsum("nk,fkd->fnd", layout.mixes, series.landmarks)
    for row, found in marks.items():
        points[row] = with_marks(layout, points[row], found)
    return points
