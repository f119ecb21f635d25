"""All cameras, the shape and the places on it at once.

The places X_n = mean_n + sum_c c_c B_cn + d_n of the surface are unknown, with Gaussian beliefs
about the coefficients c and the deviations d. Least squares over cameras and places together is
biased where views are nearly affine: turning the cameras further apart flattens the shape, and
with it every deviation from the prior, so that the turn grows without bound (48 degrees became 85
on two real photos; docs/registration.md). The cure is that of regression with noisy regressors,
instrumental variables: the equations of the cameras weigh the residuals with derivatives taken at
the prior's mean, which does not know the deviations, instead of at the estimated places, which do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.errors import EstimationError
from mien.numeric.rotation import cross_matrix, rotation_from_vector, rotation_to_vector

POSE = 6
"""Unknowns of a photo: rotation vector, shift in x and y (mm), log depth."""
_LONGEST_STEP = 0.3
"""Radians, or relative change of depth and focal length: beyond, linear steps mean nothing."""
_SETTLING = 2
"""Steps of the places alone after each common step: without them, places that lag behind their
cameras drive the next step astray, and the iteration can diverge."""
POSE_SD = np.array([0.1, 0.1, 0.1, 30.0, 30.0, 0.6])
"""How far a camera lies from where landmarks put it: rotation (rad); x and y (mm), log depth."""
_EXPECTED_MEDIAN = 0.5
"""Of the residuals over their sigmas, where matches are as good as on sharp photos. Where they are
not (small, compressed or moving faces), all sigmas grow until it is met."""


@dataclass(frozen=True)
class PlacePrior:
    """Beliefs about N places on the head.

    Attributes:
        mean: (N, 3) mm. components: (N, C, 3) mm.
        precision: (N, 3, 3) 1 / mm^2, of the deviations d.
    """

    mean: Float[Array, "n 3"]
    components: Float[Array, "n c 3"]
    precision: Float[Array, "n 3 3"]


@dataclass(frozen=True)
class Sightings:
    """M observations: photo m shows place n at image point x.

    Attributes:
        photo, place: (M,). image_points: (M, 2) px. sigma_px: (M,).
        guides: (M,) whether the cameras follow it. What slides over the face with the view, as
            a detector's landmarks do, may tell the shape, but not the cameras.
    """

    photo: Int[Array, " m"]
    place: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_px: Float[Array, " m"]
    guides: Bool[Array, " m"]


@dataclass(frozen=True)
class Lenses:
    """Focal lengths: which photos share one, and what is known of each.

    Attributes:
        group: (K,) index from 0. log_focal, deviation: (G,) mean and deviation of log(px).
    """

    group: Int[Array, " k"]
    log_focal: Float[Array, " g"]
    deviation: Float[Array, " g"]


@dataclass(frozen=True)
class JointSolution:
    """Cameras, shape and places of highest posterior.

    Attributes:
        cameras: one a photo. coefficients: (C,). places: (N, 3) mm.
        off_sigmas: (M,) length of each residual over its sigma.
        covariance: (6K + G + C) square, of the photos' steps, the log focal lengths and the
            coefficients, the places integrated out.
        converged: whether the last step was next to nothing.
    """

    cameras: tuple[Camera, ...]
    coefficients: Float[Array, " c"]
    places: Float[Array, "n 3"]
    off_sigmas: Float[Array, " m"]
    covariance: Float[Array, "q q"]
    converged: bool


@dataclass(frozen=True)
class _State:
    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    log_focal: Float[Array, " g"]
    places: Float[Array, "n 3"]
    coefficients: Float[Array, " c"]


def solve_jointly(
    cameras: Sequence[Camera],
    places: Float[Array, "n 3"],
    sightings: Sightings,
    prior: PlacePrior,
    lenses: Lenses,
    *,
    anchors: Float[Array, "k 3 3"] | None = None,
    iterations: int = 12,
    tolerance: float = 3e-4,
) -> JointSolution:
    """Gauss-Newton steps with Cauchy weights, the places eliminated from every step.

    Args:
        cameras: K starts. places: (N, 3) mm start.
        anchors: (K, 3, 3) R_cam_head that the rotations are believed to lie about; those of the
            starts unless given.
        tolerance: radians and relative changes below which a step is next to nothing.
    Raises: EstimationError: the equations have no solution.
    """
    problem = _Problem(cameras, sightings, prior, lenses, anchors)
    state = problem.start(cameras, places)
    converged = False
    for _ in range(iterations):
        state, size = problem.step(state)
        if size < tolerance:
            converged = True
            break
    return JointSolution(
        cameras=problem.cameras(cameras, state),
        coefficients=state.coefficients,
        places=state.places,
        off_sigmas=problem.off_sigmas(state),
        covariance=problem.covariance(state),
        converged=converged,
    )


@dataclass(frozen=True)
class _Linear:
    """The equations at a state, the places eliminated.

    Attributes:
        blocks: (N, 3, 3) inverses of the places' own equations. gradient: (N, 3).
        columns: (N, 6K + G, 3) coupling of the cameras to each place.
        common: (Q, Q) and right: (Q,) the equations of cameras, focal lengths, coefficients.
    """

    blocks: Float[Array, "n 3 3"]
    gradient: Float[Array, "n 3"]
    columns: Float[Array, "n d 3"]
    common: Float[Array, "q q"]
    right: Float[Array, " q"]


class _Problem:
    """Data of one call in the shapes that the equations want."""

    def __init__(
        self,
        cameras: Sequence[Camera],
        sightings: Sightings,
        prior: PlacePrior,
        lenses: Lenses,
        anchors: Float[Array, "k 3 3"] | None,
    ) -> None:
        self.seen, self.prior, self.lenses = sightings, prior, lenses
        principal = np.stack([camera.principal for camera in cameras])
        self.image = sightings.image_points - principal[sightings.photo]
        self.photos = len(cameras)
        if anchors is None:
            anchors = np.stack([camera.R_cam_head for camera in cameras])
        self.anchor_R = anchors
        self.start_t = np.stack([camera.t_cam_head for camera in cameras])
        self.size = POSE * len(cameras) + len(lenses.log_focal)
        pose = POSE * sightings.photo[:, None] + np.arange(POSE)
        focal = POSE * len(cameras) + lenses.group[sightings.photo]
        self.unknowns = np.column_stack([pose, focal])

    def start(self, cameras: Sequence[Camera], places: Array) -> _State:
        log_focal = np.log([camera.focal_px for camera in cameras])
        group = self.lenses.group
        return _State(
            np.stack([camera.R_cam_head for camera in cameras]),
            np.stack([camera.t_cam_head for camera in cameras]),
            np.bincount(group, log_focal) / np.bincount(group),
            np.array(places, float),
            np.zeros(self.prior.components.shape[1]),
        )

    def cameras(self, starts: Sequence[Camera], state: _State) -> tuple[Camera, ...]:
        return tuple(
            replace(
                camera,
                R_cam_head=state.R[k],
                t_cam_head=state.t[k],
                focal_px=float(np.exp(state.log_focal[self.lenses.group[k]])),
            )
            for k, camera in enumerate(starts)
        )

    def off_sigmas(self, state: _State) -> Float[Array, " m"]:
        residuals = self._project(state, state.places)[0] - self.image
        off: Array = np.linalg.norm(residuals, axis=1) / self.seen.sigma_px
        return off

    def step(self, state: _State) -> tuple[_State, float]:
        """The state after a step, and the step's largest rotation or relative change."""
        linear = self._linearize(state, instruments=True)
        common = _solve_scaled(linear.common, linear.right)
        cameras, coefficients = np.split(common, [self.size])
        poses = cameras[: POSE * self.photos].reshape(self.photos, POSE)
        focal = cameras[POSE * self.photos :]
        relative = np.concatenate([poses[:, :3].ravel(), poses[:, 5], focal])
        size = float(np.abs(relative).max())
        share = min(1.0, _LONGEST_STEP / max(size, 1e-12))
        pulled = linear.gradient + np.einsum("ndi,d->ni", linear.columns, cameras)
        pulled -= _apply(self.prior.precision, self._deform(coefficients))
        places = -_apply(linear.blocks, pulled)
        moved = _State(
            rotation_from_vector(share * poses[:, :3]) @ state.R,
            np.column_stack(
                [
                    state.t[:, :2] + share * poses[:, 3:5],
                    state.t[:, 2] * np.exp(share * poses[:, 5]),
                ]
            ),
            state.log_focal + share * focal,
            state.places + share * places,
            state.coefficients + share * coefficients,
        )
        for _ in range(_SETTLING):
            moved = self._settle(moved)
        return moved, size

    def _settle(self, state: _State) -> _State:
        """The places alone, a step nearer to where cameras and coefficients want them."""
        projected, _, by_place = self._project(state, state.places)
        residuals = projected - self.image
        weighted = self._weights(residuals)[:, None, None] * by_place
        count = len(self.prior.mean)
        blocks = self.prior.precision + _sum_at(
            self.seen.place, np.swapaxes(by_place, 1, 2) @ weighted, count
        )
        deviations = state.places - self.prior.mean - self._deform(state.coefficients)
        gradient = _apply(self.prior.precision, deviations) + _sum_at(
            self.seen.place, np.einsum("mij,mi->mj", weighted, residuals), count
        )
        return replace(state, places=state.places - _apply(np.linalg.inv(blocks), gradient))

    def covariance(self, state: _State) -> Float[Array, "q q"]:
        """Inverse of the symmetric equations (derivatives at the estimate on both sides)."""
        matrix = self._linearize(state, instruments=False).common
        scale = 1 / np.sqrt(np.maximum(np.diagonal(matrix), 1e-12))
        inverse: Array = np.linalg.pinv(
            matrix * np.outer(scale, scale), rcond=1e-10, hermitian=True
        )
        return inverse * np.outer(scale, scale)

    def _linearize(self, state: _State, *, instruments: bool) -> _Linear:
        place, count = self.seen.place, len(self.prior.mean)
        projected, by_camera, by_place = self._project(state, state.places)
        residuals = projected - self.image
        at_mean = by_camera
        if instruments:
            at_mean = self._project(state, self.prior.mean)[1] * self.seen.guides[:, None, None]
        weights = self._weights(residuals)
        weighted_by_place = weights[:, None, None] * by_place
        blocks = self.prior.precision + _sum_at(
            place, np.swapaxes(by_place, 1, 2) @ weighted_by_place, count
        )
        deviations = state.places - self.prior.mean - self._deform(state.coefficients)
        pull = _apply(self.prior.precision, deviations)
        gradient = pull + _sum_at(
            place, np.einsum("mij,mi->mj", weighted_by_place, residuals), count
        )
        inverse = np.linalg.inv(blocks)
        rows = self._couple(np.swapaxes(at_mean, 1, 2) @ weighted_by_place)
        columns = self._couple(np.swapaxes(by_camera, 1, 2) @ weighted_by_place)
        rows_inverse = rows @ inverse
        size, total = self.size, self.size + self.prior.components.shape[1]
        common, right = np.zeros((total, total)), np.zeros(total)
        cameras = slice(0, size)
        np.add.at(
            common,
            (self.unknowns[:, :, None], self.unknowns[:, None, :]),
            np.swapaxes(at_mean, 1, 2) @ (weights[:, None, None] * by_camera),
        )
        np.add.at(
            right, self.unknowns, -np.einsum("mij,mi->mj", at_mean, weights[:, None] * residuals)
        )
        common[cameras, cameras] -= _contract(rows_inverse, columns)
        right[cameras] += np.einsum("ndi,ni->d", rows_inverse, gradient)
        self._add_cameras(common, right, state)
        self._add_shape(common, right, state, inverse, (rows_inverse, columns), (pull, gradient))
        return _Linear(inverse, gradient, columns, common, right)

    def _add_cameras(self, common: Array, right: Array, state: _State) -> None:
        """What is known of poses (by their starts) and of focal lengths."""
        turned = rotation_to_vector(state.R @ np.swapaxes(self.anchor_R, 1, 2))
        shifted = state.t[:, :2] - self.start_t[:, :2]
        depth = np.log(state.t[:, 2:] / self.start_t[:, 2:])
        off = np.concatenate([turned, shifted, depth], axis=1).ravel()
        off = np.append(off, state.log_focal - self.lenses.log_focal)
        precision = np.append(np.tile(POSE_SD**-2, self.photos), self.lenses.deviation**-2)
        at = np.arange(self.size)
        common[at, at] += precision
        right[at] -= precision * off

    def _add_shape(
        self,
        common: Array,
        right: Array,
        state: _State,
        inverse: Array,
        coupling: tuple[Array, Array],
        gradients: tuple[Array, Array],
    ) -> None:
        """The coefficients' equations; with a place they are coupled by -B P."""
        components, precision = self.prior.components, self.prior.precision
        rows_inverse, columns = coupling
        pull, gradient = gradients
        left = precision - precision @ inverse @ precision
        shape, cameras = slice(self.size, None), slice(0, self.size)
        common[shape, shape] += _contract(components @ left, components) + np.eye(
            components.shape[1]
        )
        common[cameras, shape] += _contract(rows_inverse @ precision, components)
        common[shape, cameras] += _contract(components @ (precision @ inverse), columns)
        right[shape] += np.einsum(
            "nci,ni->c", components, pull - _apply(precision, _apply(inverse, gradient))
        )
        right[shape] -= state.coefficients

    def _project(self, state: _State, places: Array) -> tuple[Array, Array, Array]:
        """Image points less the principal points (M, 2), derivatives by the photo's seven unknowns
        (M, 2, 7) and by the place (M, 2, 3)."""
        photo = self.seen.photo
        rotation = state.R[photo]
        rotated = np.einsum("mij,mj->mi", rotation, places[self.seen.place])
        x, y, z = (rotated + state.t[photo]).T
        scale = np.exp(state.log_focal)[self.lenses.group[photo]] / z
        by_point = np.zeros((len(photo), 2, 3))
        by_point[:, 0, 0] = by_point[:, 1, 1] = scale
        by_point[:, 0, 2], by_point[:, 1, 2] = -scale * x / z, -scale * y / z
        projected = np.column_stack([scale * x, scale * y])
        by_camera = np.empty((len(photo), 2, 7))
        by_camera[..., :3] = -by_point @ cross_matrix(rotated)
        by_camera[..., 3:5] = by_point[..., :2]
        by_camera[..., 5] = by_point[..., 2] * state.t[photo, 2, None]
        by_camera[..., 6] = projected
        return projected, by_camera, by_point @ rotation

    def _weights(self, residuals: Float[Array, "m 2"]) -> Float[Array, " m"]:
        squared = (residuals**2).sum(axis=1) / self.seen.sigma_px**2
        noise = matching_noise(np.sqrt(squared[self.seen.guides]))
        variance = self.seen.sigma_px**2 * np.where(self.seen.guides, noise**2, 1.0)
        weights: Array = 1 / (variance + (residuals**2).sum(axis=1))
        return weights

    def _couple(self, blocks: Float[Array, "m 7 3"]) -> Float[Array, "n d 3"]:
        coupling = np.zeros((len(self.prior.mean), self.size, 3))
        np.add.at(coupling, (self.seen.place[:, None], self.unknowns), blocks)
        return coupling

    def _deform(self, coefficients: Float[Array, " c"]) -> Float[Array, "n 3"]:
        moved: Array = np.einsum("nci,c->ni", self.prior.components, coefficients)
        return moved


def matching_noise(off_sigmas: Float[Array, " m"]) -> float:
    """How many times larger than they are taken for the errors of matches are, at least 1."""
    median = float(np.median(off_sigmas)) if len(off_sigmas) else 0.0
    return max(1.0, median / _EXPECTED_MEDIAN)


def _apply(matrices: Float[Array, "n 3 3"], vectors: Float[Array, "n 3"]) -> Float[Array, "n 3"]:
    applied: Array = np.einsum("nij,nj->ni", matrices, vectors)
    return applied


def _contract(left: Float[Array, "n a 3"], right: Float[Array, "n b 3"]) -> Float[Array, "a b"]:
    """Sum over n of left_n right_n^T."""
    a, b = left.shape[1], right.shape[1]
    product: Array = np.swapaxes(left, 1, 2).reshape(-1, a).T @ np.swapaxes(right, 1, 2).reshape(
        -1, b
    )
    return product


def _sum_at(index: Int[Array, " m"], values: Float[Array, "m ..."], count: int) -> Array:
    """Sums of the values that share an index."""
    from scipy.sparse import csr_matrix

    flat = values.reshape(len(values), -1)
    ones = np.ones(len(index))
    gather = csr_matrix((ones, (index, np.arange(len(index)))), shape=(count, len(index)))
    sums: Array = (gather @ flat).reshape(count, *values.shape[1:])
    return sums


def _solve_scaled(matrix: Float[Array, "q q"], right: Float[Array, " q"]) -> Float[Array, " q"]:
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diagonal(matrix)), 1e-12))
    try:
        solution: Array = scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * right)
    except np.linalg.LinAlgError as error:
        raise EstimationError(
            f"cameras and shape are not determined by the photos ({error})"
        ) from error
    if not np.isfinite(solution).all():
        raise EstimationError("cameras and shape are not determined by the photos")
    return solution
