"""A head's animation: weights of its morph targets and its pose over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mien.arrays import Array, Float, check_array, check_rotation, frozen
from mien.errors import InputError


@dataclass(frozen=True)
class HeadAnimation:
    """What changes over time, linear between the times.

    Attributes:
        times: (T,) seconds from 0 up, ascending in float32, too.
        target_names: which morph targets move; the others rest at 0.
        weights: (T, N) their weights.
        rotations: (T, 3, 3) and
        translations_mm: (T, 3) take head space to the scene's: x_scene = R x_head + t; None where
            the head neither turns nor moves.
        shapes: morph targets that the file gets for this animation: (V, 3) mm over the head's
            vertices, by name.
        name: what players list it as.

    Raises:
        InputError: shapes that do not fit, NaN, no times, times that do not ascend, a name
            twice, a matrix that is no rotation.
    """

    times: Float[Array, " t"]
    target_names: tuple[str, ...] = ()
    weights: Float[Array, "t n"] | None = None
    rotations: Float[Array, "t 3 3"] | None = None
    translations_mm: Float[Array, "t 3"] | None = None
    shapes: Mapping[str, Float[Array, "v 3"]] = field(default_factory=dict)
    name: str = "animation"

    def __post_init__(self) -> None:
        times = _check_times(self.times)
        count, names = len(times), tuple(self.target_names)
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError("target_names", "each name once", f"{twice} more than once")
        weights = np.zeros((count, 0)) if self.weights is None else self.weights
        object.__setattr__(self, "times", frozen(times))
        object.__setattr__(self, "target_names", names)
        weights = check_array("weights", weights, (count, len(names)))
        object.__setattr__(self, "weights", frozen(weights))
        if self.rotations is not None:
            rotations = check_array("rotations", self.rotations, (count, 3, 3))
            for index, rotation in enumerate(rotations):
                check_rotation(f"rotations[{index}]", rotation)
            object.__setattr__(self, "rotations", frozen(rotations))
        if self.translations_mm is not None:
            translations = check_array("translations_mm", self.translations_mm, (count, 3))
            object.__setattr__(self, "translations_mm", frozen(translations))

    def weights_of(self, names: Sequence[str]) -> Float[Array, "t m"]:
        """(T, M) weights of these targets in this order, 0 where none are given.

        Raises:
            InputError: a target that moves is not among the names.
        """
        for name in self.target_names:
            if name not in names:
                raise InputError("animation", "names of the file's morph targets", name)
        assert self.weights is not None
        weights = np.zeros((len(self.times), len(names)))
        weights[:, [names.index(name) for name in self.target_names]] = self.weights
        return weights

    @property
    def quaternions(self) -> Float[Array, "t 4"] | None:
        """(T, 4) the rotations as x, y, z, w, each on the side of the one before.

        Between two of them interpolation takes the short way.
        """
        from scipy.spatial.transform import Rotation

        if self.rotations is None:
            return None
        quaternions: Array = Rotation.from_matrix(self.rotations.copy()).as_quat()
        agree = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
        signs = np.cumprod(np.concatenate([[1.0], np.where(agree < 0, -1.0, 1.0)]))
        return signs[:, None] * quaternions


def _check_times(times: Float[Array, " t"]) -> Float[Array, " t"]:
    times = check_array("times", times, (None,))
    if len(times) == 0:
        raise InputError("times", "at least one", "none")
    if times[0] < 0:
        raise InputError("times", "seconds from 0 up", f"{times[0]:g}")
    later = np.diff(times.astype(np.float32)) > 0
    if not later.all():
        index = int(np.argmin(later))
        found = f"{times[index + 1]:g} s after {times[index]:g} s at index {index + 1}"
        raise InputError("times", "each later than the one before", found)
    return times
