"""A fitted head beside the scan, and the generic head beside both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.scan import (
    Comparison,
    Scan,
    distance_to,
    face_samples,
    move,
    relative_rotation_error,
    similarity,
    start_from_shared_pixels,
)
from mien.arrays import Array, Float
from mien.assets.generic import GenericHead
from mien.camera import Camera
from mien.capture.source import CapturedView
from mien.reconstruction.result import NeutralFit

__all__ = ["Outcome", "cameras_by_stem", "outcome_of", "without_marks"]


@dataclass(frozen=True)
class Outcome:
    """A fit beside the scan.

    Attributes:
        vertices: (V, 3) mm of the fitted head.
        unfitted: (V, 3) mm, the generic head laid on it.
        fitted: their errors at the same samples.
        generic: their errors at the same samples.
        degrees: per photo after the first, error of its turn from the first.
        focal: per photo, relative error of the focal length.
    """

    vertices: Float[Array, "v 3"]
    unfitted: Float[Array, "v 3"]
    fitted: Comparison
    generic: Comparison
    degrees: list[float]
    focal: list[float]


def outcome_of(fit: NeutralFit, scan: Scan, generic: GenericHead) -> Outcome:
    """Lays a fitted head, and the generic head for comparison, on the scan."""
    cameras = cameras_by_stem(fit)
    mesh = generic.mesh.with_vertices(fit.vertices)
    attached = generic.landmark_positions(fit.vertices)[generic.landmark_attached]
    samples = face_samples(mesh, list(cameras.values()), attached)
    unfitted = move(similarity(generic.mesh.vertices, fit.vertices), generic.mesh.vertices)
    frontal = min(cameras, key=lambda name: abs(_yaw(cameras[name])))

    def compare(vertices: Float[Array, "v 3"]) -> Comparison:
        shared = start_from_shared_pixels(
            scan, mesh.with_vertices(vertices), cameras[frontal], scan.cameras[frontal]
        )
        return distance_to(scan, samples.on(vertices), similarity(*shared))

    return Outcome(
        vertices=fit.vertices,
        unfitted=unfitted,
        fitted=compare(fit.vertices),
        generic=compare(unfitted),
        degrees=relative_rotation_error(cameras, scan),
        focal=[
            abs(camera.focal_px / scan.cameras[name].focal_px - 1)
            for name, camera in cameras.items()
        ],
    )


def cameras_by_stem(fit: NeutralFit) -> dict[str, Camera]:
    """The fitted cameras by the names that scans give their photos."""
    return {Path(name).stem: photo.camera for name, photo in fit.photos.items()}


def without_marks(views: Sequence[CapturedView]) -> tuple[CapturedView, ...]:
    """The views without what was marked by hand."""
    return tuple(replace(view, annotations=None) for view in views)


def _yaw(camera: Camera) -> float:
    x, _, z = camera.center
    return float(np.arctan2(x, z))
