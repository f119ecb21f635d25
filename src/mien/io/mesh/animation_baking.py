"""The rig's motion baked into an animation of morph targets, with corrective shapes.

Morph targets add up; the rig does more: weights by region, eyes that turn, lids that stay on the
eyeballs. What the sum of the targets misses is written as a few corrective shapes, which the
animation moves, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import islice

import numpy as np

from mien.animate.timeline import Moment
from mien.arrays import Array, Float, check_positive
from mien.errors import InputError
from mien.head import NEUTRAL, Head
from mien.io.mesh.export_surface import expression_target_name, morph_offsets
from mien.io.mesh.head_animation import HeadAnimation
from mien.rig.state import FACE, FaceState, PosedFace

CORRECTIVE = "motion"
"""Corrective shapes are called motion_1, motion_2, ..."""

_BATCH = 128  # frames


def bake_animation(
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
        head: the head.
        moments: in the order of their times, one for each frame.
        evaluate: the rig's.
        tolerance_mm: how far any vertex may be from the rig's at these times.
        name: of the animation.

    Raises:
        InputError: no moment, times that do not ascend, a tolerance of 0 or less.
    """
    offsets = morph_offsets(head)
    shapes = _CorrectiveShapes(
        check_positive("tolerance_mm", tolerance_mm), head.mesh.vertices.shape
    )
    rows = _Samples()
    for batch in _batches(moments):
        named = [_named_weights(head, moment.state) for moment in batch]
        moved = [evaluate(moment.state).vertices - head.mesh.vertices for moment in batch]
        for row, missed in zip(named, moved, strict=True):
            for target, weight in row.items():
                missed -= weight * offsets[target]
        shapes.add(np.stack(moved))
        rows.add(batch, named)
    if not rows.times:
        raise InputError("moments", "at least one", "none")
    motion, moving = shapes.result()
    further = {f"{CORRECTIVE}_{index}": shape for index, shape in enumerate(moving, 1)}
    rotations, translations = rows.head_motion()
    return HeadAnimation(
        times=np.concatenate(rows.times),
        target_names=(*rows.names, *further),
        weights=np.column_stack([rows.weights(), motion]),
        rotations=rotations,
        translations_mm=translations,
        shapes=further,
        name=name,
    )


class _Samples:
    """Times, weights by target and head motion of the moments so far, as arrays."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.times: list[Array] = []
        self._weights: list[Array] = []
        self._rotations: list[Array] = []
        self._translations: list[Array] = []

    def add(self, batch: list[Moment], named: list[dict[str, float]]) -> None:
        known = set(self.names)
        self.names += [t for t in dict.fromkeys(t for row in named for t in row) if t not in known]
        weights = [[row.get(target, 0.0) for target in self.names] for row in named]
        self._weights.append(np.array(weights).reshape(len(batch), -1))
        self.times.append(np.array([moment.time for moment in batch]))
        self._rotations.append(np.stack([moment.rotation for moment in batch]))
        self._translations.append(np.stack([moment.translation for moment in batch]))

    def weights(self) -> Float[Array, "t k"]:
        """(T, K); a target that first moves later is at 0 before."""
        missing = [len(self.names) - rows.shape[1] for rows in self._weights]
        padded = [
            np.pad(rows, ((0, 0), (0, more)))
            for rows, more in zip(self._weights, missing, strict=True)
        ]
        return np.concatenate(padded)

    def head_motion(self) -> tuple[Float[Array, "t 3 3"] | None, Float[Array, "t 3"] | None]:
        """Rotations and translations; None for a head that does not turn or does not move."""
        rotations = np.concatenate(self._rotations)
        translations = np.concatenate(self._translations)
        turns = not np.array_equal(rotations, np.broadcast_to(np.eye(3), rotations.shape))
        return rotations if turns else None, translations if translations.any() else None


def _named_weights(head: Head, state: FaceState) -> dict[str, float]:
    """Weights of the targets that the file has anyway; 0 is left out."""
    weights = {unit: weight for unit, weight in state.units.items() if unit in head.unit_names}
    for name, weight in state.expressions.get(FACE, {}).items():
        if name in head.expressions and name != NEUTRAL:
            weights[expression_target_name(head, name)] = weight
    return {target: weight for target, weight in weights.items() if weight}


class _CorrectiveShapes:
    """Few shapes whose weighted sums come within a tolerance of every frame.

    Frames come in batches, so that a long performance never lies in memory. The
    principal components, about rest, of what the shapes so far miss in a batch are added until
    nothing is missed.
    """

    def __init__(self, tolerance: float, shape: tuple[int, ...]) -> None:
        self._tolerance, self._shape = tolerance, shape
        self._directions = np.zeros((0, math.prod(shape)))  # orthonormal
        self._weights: list[Array] = []

    def add(self, frames: Float[Array, "t v 3"]) -> None:
        flat = frames.reshape(len(frames), -1)
        left = flat - (flat @ self._directions.T) @ self._directions
        while np.linalg.norm(left.reshape(frames.shape), axis=-1).max(initial=0) > self._tolerance:
            _, vectors = np.linalg.eigh(left @ left.T)
            direction = vectors[:, -1] @ left
            direction /= np.linalg.norm(direction)
            left -= np.outer(left @ direction, direction)
            self._directions = np.vstack([self._directions, direction])
        self._weights += list(flat @ self._directions.T)

    def result(self) -> tuple[Float[Array, "t k"], Float[Array, "k v 3"]]:
        """Weights in [-1, 1], and the shapes in mm."""
        count = len(self._directions)
        weights = np.array([np.pad(row, (0, count - len(row))) for row in self._weights])
        largest = np.abs(weights).max(axis=0)
        return weights / largest, (largest * self._directions.T).T.reshape(-1, *self._shape)


def _batches(moments: Iterable[Moment]) -> Iterator[list[Moment]]:
    iterator = iter(moments)
    while batch := list(islice(iterator, _BATCH)):
        yield batch
