"""Heads and their face units, each computed once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mien.arrays import Array
from mien.assets.generic import load_generic_head
from mien.capture.source import load_capture
from mien.pipelines.demo import demo_photos
from mien.reconstruction.dense.eyeballs import fit_eyeballs
from mien.reconstruction.fit import FitOptions, fit_views
from mien.rig.deformer import FaceDeformer, fit_units
from mien.rig.unit_transfer import transfer_units
from people import person


@dataclass(frozen=True)
class Rigged:
    """A head, its units before and after contacts were resolved, and its deformer."""

    neutral: Array
    transferred: Array
    units: Array
    deformer: FaceDeformer

    def weights(self, **weights: float) -> Array:
        """(52,) the units' weights."""
        given = np.zeros(len(self.units))
        for name, weight in weights.items():
            given[load_generic_head().unit_names.index(name)] = weight
        return given

    def posed(self, **weights: float) -> Array:
        """(V, 3) mm: the units added up, nothing else."""
        return self.neutral + np.tensordot(self.weights(**weights), self.units, axes=1)

    def moved(self, gaze: tuple[float, float] = (0.0, 0.0), **weights: float) -> Array:
        """(V, 3) mm: with turning eyes, contacts unresolved. Gaze is yaw and pitch, radians."""
        units = self.weights(**weights)
        return self.deformer.deform(self.neutral, units, np.array(gaze), contacts=False)

    def living(self, gaze: tuple[float, float] = (0.0, 0.0), **weights: float) -> Array:
        """(V, 3) mm: with turning eyes and contacts."""
        return self.deformer.deform(self.neutral, self.weights(**weights), np.array(gaze))


def both(name: str, weight: float = 1.0) -> dict[str, float]:
    """A unit on either side of the face."""
    return {f"{name}Left": weight, f"{name}Right": weight}


@pytest.fixture(scope="session", params=["generic", "person 0", "person 1", "James"])
def rigged(request: pytest.FixtureRequest) -> Rigged:
    """The generic head, two persons whose skin is a little rough, as fitted skin is, and a man

    fitted to the marks on his photos.
    """
    generic = load_generic_head()
    vertices = np.array(generic.mesh.vertices)
    if request.param == "James":
        views = load_capture(demo_photos()).expressions["neutral"]
        fit = fit_views(views, generic, FitOptions(dense=False))
        vertices = fit_eyeballs(np.array(fit.vertices), generic)
    elif request.param != "generic":
        seed = int(request.param[-1])
        bumps = np.random.default_rng(seed).normal(size=(8, 2, 3))
        waves = np.sin(vertices @ (bumps[:, 0].T / 12)) @ bumps[:, 1] * 0.1
        vertices = person(seed) + waves
    units = fit_units(generic, vertices)
    deformer = FaceDeformer.of(generic, vertices, units)
    return Rigged(vertices, transfer_units(generic, vertices), units, deformer)
