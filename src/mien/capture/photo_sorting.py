"""Photos of one folder that show different expressions, told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mien.capture.faces.mediapipe_face import yaw_pitch
from mien.capture.source import CapturedView
from mien.capture.video.expression_selection import name_expressions
from mien.capture.video.frame_selection import (
    FrameScores,
    distance_from_rest,
    expression_distance,
)
from mien.head import NEUTRAL

SAME_EXPRESSION = 0.9
"""Of the detector's scores, the distance at which photos of a person show another expression.
Faces at rest that were photographed by several cameras at once differ by 0.6 at most, selfies of a
face at rest by 0.55 from the one most at rest, smiles and speech by 1.3 to 1.9."""
_MAX_YAW = np.radians(35)
"""Past this the scores say little."""


def sort_by_expression(
    views: Sequence[CapturedView],
) -> dict[str, tuple[CapturedView, ...]]:
    """The photos most at rest as `neutral`, the others by names for what they show.

    Photos without landmarks, and those turned so far that the detector's scores mean little, stay
    with neutral.

    Args:
        views: of one person.
    """
    scored = [view for view in views if view.landmarks is not None]
    if len(scored) < 2:
        return {NEUTRAL: tuple(views)}
    faces = [view.landmarks.as_detected_face() for view in scored if view.landmarks is not None]
    count = len(faces)
    scores = FrameScores.of(range(count), np.ones(count).tolist(), faces)
    frontal = np.array([abs(yaw_pitch(face.R_cam_head)[0]) < _MAX_YAW for face in faces])
    if np.count_nonzero(frontal) < 2:
        return {NEUTRAL: tuple(views)}
    rest = int(np.where(frontal, distance_from_rest(scores), np.inf).argmin())
    unlike = frontal & (expression_distance(scores.blendshapes, rest) > SAME_EXPRESSION)
    left = np.flatnonzero(unlike)
    groups: list[list[int]] = []
    while len(left):
        near = expression_distance(scores.blendshapes, int(left[0]))[left] <= SAME_EXPRESSION
        groups.append(left[near].tolist())
        left = left[~near]
    firsts = scores.blendshapes[[group[0] for group in groups]] if groups else np.zeros((0, 52))
    names = name_expressions(firsts, scores.blendshapes[rest])
    apart = {id(scored[k]) for group in groups for k in group}
    return {
        NEUTRAL: tuple(view for view in views if id(view) not in apart),
        **{
            name: tuple(scored[k] for k in group) for name, group in zip(names, groups, strict=True)
        },
    }


def sorting_notes(
    sorted_views: dict[str, tuple[CapturedView, ...]], *, kept: bool = True
) -> tuple[str, ...]:
    """For the user: which photos show another expression than the face at rest.

    Args:
        sorted_views: as sort_by_expression returns them.
        kept: whether they become expressions of their own.
    """
    return tuple(
        f"{', '.join(view.photo.name for view in views)}: another expression than the photos of "
        f"the face at rest; {f'kept as {name}' if kept else 'left out'}"
        for name, views in sorted_views.items()
        if name != NEUTRAL
    )
