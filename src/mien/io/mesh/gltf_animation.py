"""A head's animation in glTF 2.0: samplers and the channels that they drive."""

from __future__ import annotations

from collections.abc import Sequence

from mien.arrays import Array
from mien.errors import InputError
from mien.io.mesh.glb import GlbBuffer, Json
from mien.io.mesh.head_animation import HeadAnimation

_METRES_PER_MM = 0.001


def animation_json(
    buffer: GlbBuffer, animation: HeadAnimation, target_names: Sequence[str], *, node: int
) -> Json:
    """The animation of a node and its mesh, whose morph targets have these names.

    Raises:
        InputError: a target that moves is not among the names, nothing moves.
    """
    weights = animation.weights_of(target_names)
    samples: dict[str, Array] = {}
    if weights.size:
        samples["weights"] = weights.ravel()
    if animation.quaternions is not None:
        samples["rotation"] = animation.quaternions
    if animation.translations_mm is not None:
        samples["translation"] = _METRES_PER_MM * animation.translations_mm
    if not samples:
        raise InputError("animation", "something that moves", "neither targets nor the head")
    times = buffer.add_samples(animation.times, bounds=True)
    return {
        "name": animation.name,
        "channels": [
            {"sampler": index, "target": {"node": node, "path": path}}
            for index, path in enumerate(samples)
        ],
        "samplers": [
            {"input": times, "output": buffer.add_samples(values), "interpolation": "LINEAR"}
            for values in samples.values()
        ],
    }
