"""Supersampling, and projection of vertices that may lie in the camera's plane."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.errors import InputError

SAMPLES = (1, 4, 9)


def samples_across(samples: int) -> int:
    """Samples along the side of a pixel.

    Raises:
        InputError: not 1, 4 or 9.
    """
    if samples not in SAMPLES:
        raise InputError("samples", " or ".join(map(str, SAMPLES)), samples)
    return int(np.sqrt(samples))


def project_safely(vertices: Float[Array, "v 3"], camera: Camera) -> Float[Array, "v 2"]:
    """(V, 2) px of the vertices; not finite for one in the camera's own plane."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return camera.project(vertices)
