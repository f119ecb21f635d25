"""How far a solution is to be believed: whether it is a head, seen from where people stand."""

from __future__ import annotations

from collections.abc import Sequence

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

MAX_ODDNESS = 0.6
"""Registered heads have 0.4 to 0.53, people drawn from the identity basis 0.45; photos of two
people 0.8 and more, of one on different days, or with a wrong focal length, 0.62 to 1.1."""
MAX_ODDNESS_BY_LANDMARKS = 0.4
"""The same of a head that rests on landmarks alone: such have 0.1 to 0.27."""
DISTANCES_MM = (200.0, 20_000.0)
"""From where faces are photographed, a selfie at arm's length to a telephoto lens."""
MAX_EDGE_RESIDUAL = 1.5
"""Expected errors by which the landmarks on edges lie off in the median. Registered heads have 0.4
to 0.7; one that has followed noise had 2.4."""
MARKED = 2.0
"""Times these limits where marks were made by hand, through which the head passes whatever they
mean."""
_PRECISION_MM = 1.0
_EVERY = 3
"""Of the face's vertices, so many are enough."""


def measure_oddness(
    vertices: Float[Array, "v 3"], model: ShapeModel, generic: GenericHead
) -> float:
    """How unlikely the shape of a face is: the root mean square of its coefficients in the prior.

    After the similarity that brings it to the model's mean; expressions count nothing.

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
    return float(np.sqrt(np.mean(coefficients[: len(prior.components)] ** 2)))


def is_head(
    vertices: Float[Array, "v 3"],
    model: ShapeModel,
    features: Features,
    generic: GenericHead,
    *,
    registered: bool,
) -> bool:
    """Whether a face is one that people have.

    Args:
        vertices: (V, 3) mm.
        model: of what the photos may show.
        features: that it was fitted to.
        generic: the generic head.
        registered: whether the photos were registered by all the skin that they share.
    """
    limit = MAX_ODDNESS if registered else MAX_ODDNESS_BY_LANDMARKS
    limit *= MARKED if features.by_hand.any() else 1.0
    return measure_oddness(vertices, model, generic) < limit


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
    edge: float,
    *,
    head: bool,
    registered: bool,
    doubts: Sequence[str] = (),
    contradictions: Sequence[str] = (),
) -> Verdict:
    """One grade for the whole solution, with the reasons.

    Args:
        cameras: of the photos that were used.
        edge: as edge_residual.
        head: whether the face is one that people have.
        registered: whether the photos were registered by all the skin that they share.
        doubts: what else speaks against it being good.
        contradictions: what else speaks against believing it.
    """
    poor = [*contradictions, *distance_problems(cameras)]
    if not head:
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
