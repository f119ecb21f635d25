"""Points annotated by hand on the photos that become examples."""

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
    "load_annotated_points",
]

HEAD_POINTS = tuple(
    [f"{side}_{part}" for side in ("right", "left") for part in ("eye_outer", "eye_inner")]
    + ["right_mouth_corner", "left_mouth_corner", "nose_tip"]
)
"""The feature points among the annotations for `mien build`; their polylines hold none."""

NEIGHBOUR_SCALE = 0.12
"""Standard deviation, in widths of the face, of the Gaussian weights by which the neighbours of an
annotated point follow it."""

AnnotatedPoints = Mapping[str, Float[Array, " 2"]]
"""px, by name."""


def load_annotated_points(
    file: Path, photo: Photo, layout: FeatureLayout
) -> dict[str, Float[Array, " 2"]]:
    """Hand-annotated points beside a photo, by name, in px of the photo as loaded.

    Looked for in `STEM.tem` and `STEM.pts` beside it and in `annotations/STEM.json`, either
    `{"layout": ..., "points": ...}` or annotations as `mien build` uses them; where two of these
    have the same point, the later one counts. All are in px of the photo's file, turned upright. A
    file of points that mien does not know is left out; `annotation_notes` says so.

    Args:
        file: the photo's.
        photo: as loaded.
        layout: of the points.

    Raises:
        FileFormatError: one of them is damaged; says where.
    """
    paths = annotation_files(file)
    for_heads = [path for path in paths if _is_for_heads(path)]
    annotated: dict[str, Array] = {}
    for path in (path for path in paths if path not in for_heads):
        with suppress(OtherPointsError):
            rows, points = load_feature_points(path, layout)
            named = zip(rows, points, strict=True)
            annotated |= {layout.names[row]: point * photo.scale for row, point in named}
    for path in for_heads:
        names = AnnotationNames.of(load_generic_head())
        of_head = load_annotations(path, photo, names=names).points
        known = [name for name in HEAD_POINTS if name in of_head and name in layout.names]
        annotated |= {name: of_head[name] for name in known}
    return annotated


def annotation_notes(file: Path, layout: FeatureLayout) -> list[str]:
    """Which files beside a photo hold points that mien does not know.

    Args:
        file: the photo's.
        layout: of the points.

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
    """Files with annotations of a photo, by rising precedence.

    Args:
        file: the photo's.
    """
    annotations = file.parent / ANNOTATIONS / f"{file.stem}.json"
    paths = (file.with_suffix(".tem"), file.with_suffix(".pts"), annotations)
    return [path for path in paths if path.is_file()]


def _is_for_heads(path: Path) -> bool:
    return path.suffix == ".json" and "layout" not in read_json(path)


def apply_annotations(
    layout: FeatureLayout, points: Float[Array, "n 2"], annotated: AnnotatedPoints
) -> Float[Array, "n 2"]:
    """Detected points with annotated ones in their places; their neighbours follow in part.

    Args:
        layout: of the points.
        points: (n, 2) px, detected.
        annotated: px, by name.
    """
    if not annotated:
        return points
    rows = [layout.index(name) for name in annotated]
    offsets = np.stack(list(annotated.values())) - points[rows]
    scale = NEIGHBOUR_SCALE * float(np.ptp(points[:, 0]))
    distances = np.linalg.norm(points[:, None] - points[rows], axis=2) / scale
    weights = np.exp(-(distances**2) / 2)
    result: Array = points + weights @ offsets / np.maximum(weights.sum(axis=1), 1)[:, None]
    result[rows] = points[rows] + offsets
    return result


def apply_all_annotations(
    layout: FeatureLayout, points: Float[Array, "N n 2"], annotated: Mapping[int, AnnotatedPoints]
) -> Float[Array, "N n 2"]:
    """Detected points of all pictures with annotated ones in their places.

    Args:
        layout: of the points.
        points: (N, n, 2) px, detected.
        annotated: px, by row and name.
    """
    result: Array = points.copy()
    for row, own in annotated.items():
        result[row] = apply_annotations(layout, points[row], own)
    return result
