"""Points that a person marked by hand on the photos that become examples."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from mien.arrays import Array, Float
from mien.assets.feature_points import FeatureLayout
from mien.assets.generic import load_generic_head
from mien.capture.annotations import AnnotationNames, load_annotations
from mien.capture.folder import ANNOTATIONS
from mien.capture.images.photos import Photo
from mien.errors import OtherPointsError
from mien.io.landmarks.points_file import load_feature_points
from mien.reading.strict_json import read_json

__all__ = [
    "annotation_files",
    "annotation_notes",
    "apply_all_annotations",
    "apply_annotations",
    "read_annotated_points",
]

OF_HEADS = tuple(
    [f"{side}_{part}" for side in ("right", "left") for part in ("eye_outer", "eye_inner")]
    + ["right_mouth_corner", "left_mouth_corner", "nose_tip"]
)
"""What marks made for `mien build` share with the feature points; their polylines do not."""

REACH = 0.12
"""Points this near to a marked one, in widths of the face, follow it by 0.6 of its way."""

Marks = Mapping[str, Float[Array, " 2"]]


def read_annotated_points(
    file: Path, photo: Photo, layout: FeatureLayout
) -> dict[str, Float[Array, " 2"]]:
    """Hand-made marks beside a photo, by point, in px of the photo as loaded.

    Looked for in `STEM.tem` and `STEM.pts` beside it and in `annotations/STEM.json`, either
    `{"layout": ..., "points": ...}` or marks as `mien build` uses them; where two of these mark
    the same point, the later one counts. All are in px of the photo's file, turned upright. A file
    of points that mien does not know is left out; `annotation_notes` tells.

    Raises:
        FileFormatError: one of them is damaged; says where.
    """
    sources = annotation_files(file)
    for_heads = [path for path in sources if _is_for_heads(path)]
    found: dict[str, Array] = {}
    for path in (path for path in sources if path not in for_heads):
        with suppress(OtherPointsError):
            rows, places = load_feature_points(path, layout)
            found |= {layout.names[r]: at * photo.scale for r, at in zip(rows, places, strict=True)}
    for path in for_heads:
        names = AnnotationNames.of(load_generic_head())
        points = load_annotations(path, photo, names=names).points
        found |= {n: points[n] for n in OF_HEADS if n in points and n in layout.names}
    return found


def annotation_notes(file: Path, layout: FeatureLayout) -> list[str]:
    """Which files beside a photo hold points that mien does not know.

    Raises:
        FileFormatError: one of them is damaged.
    """
    notes = []
    for path in annotation_files(file):
        try:
            if not _is_for_heads(path):
                load_feature_points(path, layout)
        except OtherPointsError as error:
            notes.append(f"{path.name} is not used: {error.problem}")
    return notes


def annotation_files(file: Path) -> list[Path]:
    """Where a photo's marks are, those that count most last."""
    annotations = file.parent / ANNOTATIONS / f"{file.stem}.json"
    places = (file.with_suffix(".tem"), file.with_suffix(".pts"), annotations)
    return [path for path in places if path.is_file()]


def _is_for_heads(path: Path) -> bool:
    return path.suffix == ".json" and "layout" not in read_json(path)


def apply_annotations(
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


def apply_all_annotations(
    layout: FeatureLayout, points: Float[Array, "N n 2"], marks: Mapping[int, Marks]
) -> Float[Array, "N n 2"]:
    """Detected points of all pictures; marks, by row, win."""
    result: Array = points.copy()
    for row, found in marks.items():
        result[row] = apply_annotations(layout, points[row], found)
    return result
