"""The joint problem's places: how far off they are, and how they answer to cameras and shape.

Letters as in mien.reconstruction.dense.joint_equations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.numeric.segment_sum import SegmentSum
from mien.reconstruction.dense.joint_problem import CameraPrior, JointState, PlacePrior, Sightings
from mien.reconstruction.dense.projection import Projection, project_places

_EXPECTED_MEDIAN = 0.5
"""Of the residuals over their sigmas, where matches are as good as on sharp photos. Where they are
not (small, compressed or moving faces), all sigmas grow until it is met."""


class JointProblem:
    """What is given, in the shapes that the equations want."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        sightings: Sightings,
        prior: PlacePrior,
        believed: CameraPrior,
    ) -> None:
        self.seen, self.prior, self.believed = sightings, prior, believed
        principal = np.stack([camera.principal for camera in cameras])
        self.image = sightings.image_points - principal[sightings.photo]
        places, photos = len(prior.mean), len(cameras)
        self.by_place = SegmentSum(sightings.place, places)
        self.by_photo = SegmentSum(sightings.photo, photos)
        both = sightings.place * photos + sightings.photo
        self.by_place_and_photo = SegmentSum(both, places * photos)
        # (3N, C): as one matrix, so that sums over places are single products.
        self.basis = np.ascontiguousarray(prior.components.reshape(len(prior.components), -1).T)

    def project(self, state: JointState, places: Float[Array, "n 3"]) -> Projection:
        """The sightings that the state's cameras would have of these places."""
        pinholes = state.pinholes(self.believed.lenses.group)
        return project_places(pinholes, self.seen.photo, places[self.seen.place])

    def deviations(self, state: JointState) -> Float[Array, "n 3"]:
        """(N, 3) mm: d, what the components do not explain."""
        explained = self.prior.mean + (self.basis @ state.coefficients).reshape(-1, 3)
        return state.places - explained


def matching_noise(off_sigmas: Float[Array, " m"]) -> float:
    """How many times larger than they are taken for the errors of matches are, at least 1."""
    median = float(np.median(off_sigmas)) if len(off_sigmas) else 0.0
    return max(1.0, median / _EXPECTED_MEDIAN)


@dataclass(frozen=True)
class Misfit:
    """How far sightings are from what a state predicts.

    Attributes:
        seen: the prediction.
        residuals: (M, 2) px, predicted less observed.
        weights: (M,) 1 / px^2, Cauchy's over the variances, which grow until those of guides are as
            large as their errors.
    """

    seen: Projection
    residuals: Float[Array, "m 2"]
    weights: Float[Array, " m"]


def misfit_at(problem: JointProblem, state: JointState) -> Misfit:
    """The misfit of a state."""
    seen = problem.project(state, state.places)
    residuals = seen.image_points - problem.image
    squared = (residuals**2).sum(axis=1)
    variance, guides = problem.seen.sigma_px**2, problem.seen.guides
    noise = matching_noise(np.sqrt(squared / variance)[guides])
    weights = 1 / (variance * np.where(guides, noise**2, 1.0) + squared)
    return Misfit(seen, residuals, weights)


@dataclass(frozen=True)
class OwnEquations:
    """The places' equations while cameras and coefficients stay.

    Attributes:
        inverse: (N, 3, 3) mm^2.
        gradient: (N, 3) 1 / mm.
        pull: (N, 3), its part by beliefs.
    """

    inverse: Float[Array, "n 3 3"]
    gradient: Float[Array, "n 3"]
    pull: Float[Array, "n 3"]


def own_equations(problem: JointProblem, state: JointState, misfit: Misfit) -> OwnEquations:
    """Of each place: P + sum b'wb, inverted, and P d + sum b'wr.

    Raises:
        numpy.linalg.LinAlgError: neither photos nor beliefs hold a place.
    """
    by_place, precision = misfit.seen.by_place, problem.prior.precision
    weighted = np.swapaxes(misfit.weights[:, None, None] * by_place, 1, 2)
    information = precision + problem.by_place(weighted @ by_place)
    pull = apply_each(precision, problem.deviations(state))
    gradient = pull + problem.by_place(apply_each(weighted, misfit.residuals))
    return OwnEquations(np.linalg.inv(information), gradient, pull)


def settle_places(problem: JointProblem, state: JointState) -> JointState:
    """The state after a step of the places alone."""
    own = own_equations(problem, state, misfit_at(problem, state))
    return replace(state, places=state.places - apply_each(own.inverse, own.gradient))


@dataclass(frozen=True)
class Rows:
    """Equations matrix @ step = right between Q unknowns: D of the cameras, then coefficients.

    Attributes:
        matrix: (A, Q).
        right: (A,).
    """

    matrix: Float[Array, "a q"]
    right: Float[Array, " a"]


@dataclass(frozen=True)
class Elimination:
    """How the places answer to steps of cameras and coefficients.

    Attributes:
        own: their own equations.
        columns: (N, 3, D) sums of b'wa.
    """

    problem: JointProblem
    own: OwnEquations
    columns: Float[Array, "n 3 d"]

    def step(self, common: Float[Array, " q"]) -> Float[Array, "n 3"]:
        """(N, 3) mm, given the step of cameras and coefficients."""
        cameras, coefficients = np.split(common, [self.columns.shape[2]])
        explained = (self.problem.basis @ coefficients).reshape(-1, 3)
        pulled = self.own.gradient + self.columns @ cameras
        pulled -= apply_each(self.problem.prior.precision, explained)
        return -apply_each(self.own.inverse, pulled)

    def eliminate(self, by_place: Float[Array, "n 3 a"], rows: Rows) -> Rows:
        """Equations rows.matrix @ step + sum by_place' x = rows.right, without the places' x."""
        answered = self.own.inverse @ by_place
        cameras = flat(answered).T @ flat(self.columns)
        shape = flat(self.problem.prior.precision @ answered).T @ self.problem.basis
        return Rows(
            rows.matrix + np.concatenate([-cameras, shape], axis=1),
            rows.right + self.own.gradient.ravel() @ flat(answered),
        )


def flat(blocks: Float[Array, "n 3 a"]) -> Float[Array, "n*3 a"]:
    """As one matrix, so that a sum over places is a product."""
    return blocks.reshape(-1, blocks.shape[2])


def apply_each(matrices: Float[Array, "n a b"], vectors: Float[Array, "n b"]) -> Array:
    """(N, A): every matrix times its vector."""
    return (matrices @ vectors[..., None])[..., 0]
