"""How heads differ: random heads from MakeHuman's identity targets, and their principal modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from tools.assets.head import IPD_MM, HeadCut
from tools.assets.makehuman import MakeHuman, Slider

# How much the sliders of each folder vary (standard deviation; a slider's range is -1 to 1). Those
# that reshape the whole skull act on tens of millimetres and are kept smaller.
_SPREADS = {
    "head": 0.15,
    "forehead": 0.15,
    "eyebrows": 0.3,
    "eyes": 0.25,
    "nose": 0.2,
    "cheek": 0.3,
    "mouth": 0.2,
    "chin": 0.25,
    "ears": 0.2,
    "neck": 0.15,
    "asym": 0.1,
}
# The distance between the eyes sets the scale of head space: kept to a few per cent.
_EYE_DISTANCE = "eyes/l-eye-trans-out"
_EYE_DISTANCE_SPREAD = 0.15
# A slider without a left and a right that moves a feature sideways is an asymmetry too.
_SIDEWAYS = ("nose/nose-trans-out", "mouth/mouth-trans-out", "head/head-trans-out")
_SIDE_SPREAD = 0.05


@dataclass(frozen=True)
class Population:
    """Random heads and the modes along which they differ.

    Attributes:
        components: (K, V, 3) mm at unit standard deviation, strongest first.
        variance_kept: share of the weighted variance that the components explain.
        residual_mm: root mean square of what they leave on the weighted surface.
    """

    components: Float[Array, "k v 3"]
    variance_kept: float
    residual_mm: float


def sample_heads(
    source: MakeHuman, head: HeadCut, count: int, rng: np.random.Generator
) -> Float[Array, "n v 3"]:
    """Offsets in mm of random heads from the mean head, every slider drawn by itself.

    Sliders have mean 0; paired ones move both sides together but for a small difference, and
    those made for asymmetry move little. Gender, age, ancestry, weight and muscle mix
    MakeHuman's macro targets.

    Returns:
        (count, V, 3), each aligned so that the eyes' centres stay where they are.
    """
    offsets = _macro_offsets(source, head, count, rng)
    for folder, spread in _SPREADS.items():
        for group in source.sliders(folder):
            shared = rng.normal(0, _spread(group[0], spread), count)
            for slider in group:
                value = shared if len(group) == 1 else shared + rng.normal(0, _SIDE_SPREAD, count)
                _add_slider(offsets, source, head, slider, np.clip(value, -1, 1))
    return _aligned(offsets, head)


def _spread(slider: Slider, of_folder: float) -> float:
    if slider.positive in _SIDEWAYS:
        return _SPREADS["asym"]
    return _EYE_DISTANCE_SPREAD if slider.positive == _EYE_DISTANCE else of_folder


def _add_slider(
    offsets: Float[Array, "n v 3"],
    source: MakeHuman,
    head: HeadCut,
    slider: Slider,
    value: Float[Array, " n"],
) -> None:
    positive = head.offsets_mm(source.target(slider.positive))
    negative = head.offsets_mm(source.target(slider.negative)) if slider.negative else -positive
    for ends, weights in ((positive, np.maximum(value, 0)), (negative, np.maximum(-value, 0))):
        moved = np.flatnonzero(np.abs(ends).max(1) > 0)
        offsets[:, moved] += (weights[:, None, None] * ends[moved]).astype(np.float32)


def _macro_offsets(
    source: MakeHuman, head: HeadCut, count: int, rng: np.random.Generator
) -> Float[Array, "n v 3"]:
    """Offsets from the mean head by gender, age, ancestry, weight and muscle."""
    offsets = np.zeros((count, len(head.source), 3), np.float32)
    female = rng.beta(0.7, 0.7, count)
    old = np.clip(rng.uniform(-0.3, 0.7, count), 0, None)
    ancestry = rng.dirichlet((0.6, 0.6, 0.6), count)
    weight, muscle = (_three_way(rng.normal(0, 0.35, count)) for _ in range(2))

    def add(name: str, weights: Float[Array, " n"], mean: float) -> None:
        target = head.offsets_mm(source.target(f"macrodetails/{name}"))
        offsets[:] += ((weights - mean)[:, None, None] * target).astype(np.float32)

    for gender, share in (("female", female), ("male", 1 - female)):
        for age, of_age in (("young", 1 - old), ("old", old)):
            young = float(age == "young")
            for index, name in enumerate(("african", "asian", "caucasian")):
                add(f"{name}-{gender}-{age}", share * of_age * ancestry[:, index], young / 6)
            for muscle_name, of_muscle in muscle.items():
                for weight_name, of_weight in weight.items():
                    name = f"universal-{gender}-{age}-{muscle_name}muscle-{weight_name}weight"
                    average = muscle_name == weight_name == "average"
                    add(name, share * of_age * of_muscle * of_weight, young / 2 * average)
    return offsets


def _three_way(value: Float[Array, " n"]) -> dict[str, Float[Array, " n"]]:
    """Shares of MakeHuman's three targets for a slider from -1 to 1."""
    value = np.clip(value, -1, 1)
    return {
        "min": np.maximum(-value, 0),
        "average": 1 - np.abs(value),
        "max": np.maximum(value, 0),
    }


def _aligned(offsets: Float[Array, "n v 3"], head: HeadCut) -> Float[Array, "n v 3"]:
    """The same heads turned, moved and scaled so that the eyes' centres stay in their places.

    Size is thereby known relative to the interpupillary distance, as head space demands. What is
    left of the rotation, about the axis through the eyes, is chosen to match the face.
    """
    left, right = head.vertices_of("left_eyeball"), head.vertices_of("right_eyeball")
    skin = head.vertices_of("skin")
    front = skin[(head.vertices[skin, 2] > -20) & (head.vertices[skin, 1] > -115)]
    for index in range(len(offsets)):
        shape = head.vertices + offsets[index]
        a, b = shape[left].mean(0), shape[right].mean(0)
        shape = (shape - (a + b) / 2) * (IPD_MM / np.linalg.norm(a - b))
        shape = shape @ _axes(a - b).T
        y, z = shape[front, 1], shape[front, 2]
        y0, z0 = head.vertices[front, 1], head.vertices[front, 2]
        angle = np.arctan2((y * z0 - z * y0).sum(), (y * y0 + z * z0).sum())
        c, s = np.cos(angle), np.sin(angle)
        shape = shape @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
        offsets[index] = shape - head.vertices
    return offsets


def _axes(eyes: Float[Array, " 3"]) -> Float[Array, "3 3"]:
    """The rotation that turns this direction onto x and keeps y as upright as it can."""
    x = eyes / np.linalg.norm(eyes)
    z = np.cross(x, (0.0, 1.0, 0.0))
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def principal_modes(
    offsets: Float[Array, "n v 3"], head: HeadCut, weights: Float[Array, " v"], count: int
) -> Population:
    """The strongest independent modes of the heads and their mirror images.

    As every head comes with its mirror image, each mode is either symmetric or antisymmetric;
    the two kinds are analysed apart.

    Args:
        weights: (V,) importance of each vertex.
        count: number of modes kept.
    """
    centred = offsets - offsets.mean(0)
    mirrored = centred[:, head.mirror] * np.array([-1, 1, 1], np.float32)
    halves = [_modes((centred + sign * mirrored) / 2, weights, count) for sign in (1, -1)]
    strengths = np.concatenate([half[1] for half in halves])
    components = np.concatenate([half[0] for half in halves])
    total = sum(half[2] for half in halves)
    order = np.argsort(-strengths, kind="stable")[:count]
    kept = float(strengths[order].sum())
    return Population(
        components[order].reshape(count, -1, 3),
        kept / total,
        float(np.sqrt((total - kept) / weights.sum())),
    )


def _modes(
    centred: Float[Array, "n v 3"], weights: Float[Array, " v"], count: int
) -> tuple[Float[Array, "k m"], Float[Array, " k"], float]:
    """Modes at unit standard deviation, the weighted variance of each, and that of all."""
    flat = centred.reshape(len(centred), -1).astype(np.float64)
    gram = (flat * np.repeat(weights, 3)) @ flat.T / len(flat)
    values, vectors = np.linalg.eigh(gram)
    values, vectors = values[::-1][:count], vectors[:, ::-1][:, :count]
    modes = vectors.T @ flat / np.sqrt(len(flat))
    largest = np.abs(modes).argmax(1)
    modes *= np.sign(modes[np.arange(len(modes)), largest])[:, None]
    return modes, values, float(np.trace(gram))
