"""A performance of the rig as an animation of morph targets, exact where targets alone are not.

Morph targets add up; the rig does more: weights by region, eyes that turn, lids that stay on the
eyeballs. What the sum of the targets misses is written as a few shapes more, which the animation
moves along.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from mien.animate.timeline import Moment
from mien.arrays import Array, Float
from mien.errors import InputError
from mien.expressions.state import FACE, FaceState, PosedFace
from mien.formats.head_animation import HeadAnimation
from mien.formats.surface import expression_target, target_offsets
from mien.model.head import NEUTRAL, Head

MOTION = "motion"
"""The further shapes are called motion_1, motion_2, …"""


def performance(
    head: Head,
    moments: Iterable[Moment],
    evaluate: Callable[[FaceState], PosedFace],
    *,
    tolerance_mm: float = 0.1,
    name: str = "performance",
) -> HeadAnimation:
    """The animation that shows these moments.

    Face units and expressions of the whole face keep their names and weights.

    Args:
        moments: in the order of their times, one for each frame.
        evaluate: the rig's.
        tolerance_mm: how far any vertex may be from the rig's at these times.
    Raises: InputError: no moment, times that do not ascend.
    """
    offsets = target_offsets(head)
    played, weights, missed = [], [], []
    for moment in moments:
        row = _named_weights(head, moment.state)
        moved = evaluate(moment.state).vertices - head.mesh.vertices
        for target, weight in row.items():
            moved = moved - weight * offsets[target]
        played.append(moment)
        weights.append(row)
        missed.append(moved.astype(np.float32))
    if not played:
        raise InputError("moments", "at least one", "none")
    motion, shapes = _fewest_shapes(np.stack(missed), tolerance_mm)
    names = tuple(dict.fromkeys(target for row in weights for target in row))
    named = np.array([[row.get(target, 0.0) for target in names] for row in weights])
    rotations, translations = _head_motion(played)
    further = {f"{MOTION}_{index}": shape for index, shape in enumerate(shapes, 1)}
    return HeadAnimation(
        times=np.array([moment.time for moment in played]),
        target_names=(*names, *further),
        weights=np.column_stack([named.reshape(len(played), -1), motion]),
        rotations=rotations,
        translations_mm=translations,
        shapes=further,
        name=name,
    )


def _named_weights(head: Head, state: FaceState) -> dict[str, float]:
    """Weights of the targets that the file has anyway; 0 is left out."""
    weights = {unit: weight for unit, weight in state.units.items() if unit in head.unit_names}
    for name, weight in state.expressions.get(FACE, {}).items():
        if name in head.expressions and name != NEUTRAL:
            weights[expression_target(head, name)] = weight
    return {target: weight for target, weight in weights.items() if weight}


def _fewest_shapes(
    motion: Float[Array, "t v 3"], tolerance: float
) -> tuple[Float[Array, "t k"], Float[Array, "k v 3"]]:
    """Weights in [-1, 1] and shapes whose sums come within tolerance of the motion.

    The shapes are the motion's principal components about rest, taken until all is reached.
    """
    left = motion.reshape(len(motion), -1)
    _, vectors = np.linalg.eigh((left @ left.T).astype(np.float64))
    weights, shapes = np.zeros((len(motion), 0)), np.zeros((0, *motion.shape[1:]))
    for vector in vectors.T[::-1]:
        if np.linalg.norm(left.reshape(motion.shape), axis=-1).max(initial=0.0) <= tolerance:
            break
        shape = vector @ left
        left = left - np.outer(vector, shape).astype(np.float32)
        largest = np.abs(vector).max()
        weights = np.column_stack([weights, vector / largest])
        shapes = np.concatenate([shapes, (largest * shape).reshape(1, *motion.shape[1:])])
    return weights, shapes


def _head_motion(
    moments: list[Moment],
) -> tuple[Float[Array, "t 3 3"] | None, Float[Array, "t 3"] | None]:
    """Rotations and translations; None for a head that does not turn or does not move."""
    rotations = np.stack([moment.rotation for moment in moments])
    translations = np.stack([moment.translation for moment in moments])
    turns = not np.array_equal(rotations, np.broadcast_to(np.eye(3), rotations.shape))
    return rotations if turns else None, translations if translations.any() else None
