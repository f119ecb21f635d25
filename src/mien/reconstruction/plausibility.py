"""How far a solution is to be believed: whether it is a head, seen from where people stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.head import Grade, Verdict
from mien.numeric.similarity import estimate_similarity
from mien.reconstruction.dense.prior import load_head_prior
from mien.reconstruction.features import Features
from mien.reconstruction.outliers import MIN_PARALLAX_DEG, largest_view_angle
from mien.reconstruction.shape.model import ShapeModel

MAX_IDENTITY, MAX_DEVIATION = 0.78, 0.6
"""Root mean square of a head's coefficients in the prior, of identity and of smooth deviations.
Registered heads have at most 0.6 and 0.5; those of unlike photos, and of two people in one folder,
0.9 to 1.3 and 0.6 to 1.5."""
WORN_OUT = 1.35
"""Times these limits at which a head that rests on landmarks is no head any more: nothing else
corrects them."""
DISTANCES_MM = (200.0, 20_000.0)
"""From where faces are photographed, a selfie at arm's length to a telephoto lens."""
MAX_EDGE_RESIDUAL = 1.5
"""Expected errors by which the landmarks on edges lie off in the median. Registered heads have 0.4
to 0.7; one that has followed noise had 2.4."""
_PRECISION_MM = 1.0
_EVERY = 3
"""Of the face's vertices, so many are enough."""


@dataclass(frozen=True)
class Oddness:
    """How unlikely a face's shape is.

    Attributes:
        identity: root mean square of its coefficients in the identity basis; 1 is usual of people
            drawn from it, 0.5 of what photos tell of them.
        deviation: the same of smooth deviations from the basis.
    """

    identity: float
    deviation: float

    def exceeds(self, factor: float = 1.0) -> bool:
        """Whether it is beyond `factor` times what registered heads have."""
        limits = factor * MAX_IDENTITY, factor * MAX_DEVIATION
        return self.identity > limits[0] or self.deviation > limits[1]


def measure_oddness(
    vertices: Float[Array, "v 3"], model: ShapeModel, generic: GenericHead
) -> Oddness:
    """Of the face, after the similarity that brings it to the model's mean; expressions are free.

    Args:
        vertices: (V, 3) mm.
        model: of what the photos may show.
        generic: the generic head.
    """
    prior = load_head_prior()
    face = np.flatnonzero(generic.regions["face"] > 0.5)[::_EVERY]
    count = prior.identity_count
    units = model.components[count:]
    components = np.concatenate([prior.components, units])[:, face]
    basis = components.reshape(len(components), -1).T / _PRECISION_MM
    aligned = estimate_similarity(vertices[face], model.mean[face])(vertices[face])
    offsets = (aligned - model.mean[face]).ravel() / _PRECISION_MM
    coefficients = np.linalg.solve(basis.T @ basis + np.eye(basis.shape[1]), basis.T @ offsets)
    identity = coefficients[:count]
    deviation = coefficients[count : len(prior.components)]
    return Oddness(*(float(np.sqrt(np.mean(part**2))) for part in (identity, deviation)))


def edge_residual(
    features: Features, cameras: Sequence[Camera], residuals: Float[Array, "k n 2"]
) -> float:
    """Median normalized residual of the landmarks on edges; 0 without landmarks."""
    used = features.observed & features.on_edges
    if not used.any():
        return 0.0
    off = np.linalg.norm(residuals, axis=2)[used] / features.sigma_px(cameras)[used]
    return float(np.median(off))


def distance_problems(cameras: Sequence[Camera]) -> tuple[str, ...]:
    """What is wrong with the places from which the photos would have been taken."""
    nearest, farthest = DISTANCES_MM
    distances = [float(camera.t_cam_head[2]) for camera in cameras]
    if min(distances) < nearest:
        return (f"a camera would be {min(distances):.0f} mm from the face",)
    if max(distances) > farthest:
        return (f"a camera would be {max(distances) / 1000:.0f} m from the face",)
    return ()


def judge(
    cameras: Sequence[Camera],
    oddness: Oddness,
    edge: float,
    *,
    registered: bool,
    doubts: Sequence[str] = (),
) -> Verdict:
    """One grade for the whole solution, with the reasons.

    Args:
        cameras: of the photos that were used.
        oddness: of the head.
        edge: as edge_residual.
        registered: whether the photos were registered by all the skin that they share.
        doubts: what else speaks against it being good.
    """
    poor = [*distance_problems(cameras)]
    if oddness.exceeds(1.0 if registered else WORN_OUT):
        poor.append("the shape is none that heads have")
    if edge > MAX_EDGE_RESIDUAL:
        poor.append("the features of the face lie far from where the photos show them")
    fair = [*doubts]
    if len(cameras) == 1:
        fair.append("one photo: depth comes from the prior of faces, not from this person")
    elif not registered:
        fair.append("cameras and shape rest on marks and landmarks alone")
    elif largest_view_angle(cameras) < MIN_PARALLAX_DEG:
        fair.append("the photos look from nearly one side")
    grade: Grade = "poor" if poor else "fair" if fair else "good"
    return Verdict(grade, tuple(poor or fair))
