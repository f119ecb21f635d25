"""Cameras and face units together: what of an expression the units can express."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.reconstruction.bundle.projection import CAMERA_SIZE
from mien.reconstruction.expression.known_head import KnownHead
from mien.reconstruction.observations import SurfaceObservations, reproject

UNIT_SD = 0.35
"""Standard deviation of a unit's weight from the detector's score."""
MAX_WEIGHT = 1.2
"""A unit goes no farther than this."""
_ROUNDS = 12
_CONVERGED = 1e-4


@dataclass(frozen=True)
class UnitFit:
    """What explains the photos of an expression.

    Attributes:
        cameras: one a photo.
        weights: (52,) of the face units, 0 to 1.2.
    """

    cameras: tuple[Camera, ...]
    weights: Float[Array, " 52"]

    def vertices(self, known: KnownHead) -> Float[Array, "v 3"]:
        """(V, 3) mm: the head as the units have it."""
        return known.vertices + np.tensordot(self.weights, known.units, axes=1)


def fit_unit_weights(
    observations: SurfaceObservations,
    start: UnitFit,
    expected: Float[Array, " 52"],
    focal_sd: Float[Array, " k"],
    known: KnownHead,
    *,
    free: Bool[Array, " 52"],
) -> UnitFit:
    """Cameras and unit weights of highest posterior.

    Minimizes the Cauchy-weighted squared reprojection errors, in units of their sigma, plus
    the squared deviations of weights from `expected` and of log focal lengths from the start's;
    weights stay within 0 and 1.2.

    Args:
        observations: of all photos.
        start: initial values.
        expected: (52,) units by the detector's scores.
        focal_sd: (K,) standard deviation of log focal lengths.
        known: the neutral head.
        free: (52,) the units to solve for; the others stay at 0.
    """
    from scipy.optimize import lsq_linear

    units = np.flatnonzero(free)
    basis = observations.on(known.units[units]) if len(units) else np.zeros((0, 0, 3))
    rest = observations.on(known.vertices) + observations.offset
    focal = np.log([camera.focal_px for camera in start.cameras])
    state = start
    for _ in range(_ROUNDS):
        matrix, gradient = _normal_equations(observations, state, rest, basis, units)
        count = len(state.cameras)
        focal_rows = CAMERA_SIZE * np.arange(count) + CAMERA_SIZE - 1
        now = np.log([camera.focal_px for camera in state.cameras])
        matrix[focal_rows, focal_rows] += 1 / focal_sd**2
        gradient[focal_rows] += (now - focal) / focal_sd**2
        own = CAMERA_SIZE * count + np.arange(len(units))
        matrix[own, own] += 1 / UNIT_SD**2
        gradient[own] += (state.weights[units] - expected[units]) / UNIT_SD**2
        matrix[np.diag_indices_from(matrix)] *= 1 + 1e-6
        root = np.linalg.cholesky(matrix).T
        low, high = np.full(len(matrix), -np.inf), np.full(len(matrix), np.inf)
        low[own], high[own] = -state.weights[units], MAX_WEIGHT - state.weights[units]
        high[own] = np.maximum(high[own], low[own] + 1e-9)
        step = lsq_linear(root, -np.linalg.solve(root.T, gradient), bounds=(low, high)).x
        state = _moved(state, step, units)
        if np.abs(step).max() < _CONVERGED:
            break
    return state


def _normal_equations(
    observations: SurfaceObservations,
    state: UnitFit,
    rest: Float[Array, "m 3"],
    basis: Float[Array, "u m 3"],
    units: Array,
) -> tuple[Array, Array]:
    """J^T W J and J^T W r over all cameras' unknowns and the weights."""
    photo, count = observations.photo, len(state.cameras)
    points = rest + np.tensordot(state.weights[units], basis, axes=1) if len(units) else rest
    errors = reproject(observations, points, state.cameras)
    jacobian = np.zeros((len(photo), 2, CAMERA_SIZE * count + len(units)))
    rows = np.arange(len(photo))[:, None]
    columns = CAMERA_SIZE * photo[:, None] + np.arange(CAMERA_SIZE)
    jacobian[rows, :, columns] = np.swapaxes(errors.projection.camera_jacobian(), 1, 2)
    if len(units):
        jacobian[:, :, CAMERA_SIZE * count :] = np.einsum(
            "mij,umj->miu", errors.projection.point_jacobian, basis
        )
    flat = jacobian.reshape(-1, jacobian.shape[2])
    weighted = flat * np.repeat(errors.weights, 2)[:, None]
    return weighted.T @ flat, weighted.T @ errors.residuals.ravel()


def _moved(state: UnitFit, step: Array, units: Array) -> UnitFit:
    count = len(state.cameras)
    cameras = []
    for camera, move in zip(
        state.cameras, step[: CAMERA_SIZE * count].reshape(count, CAMERA_SIZE), strict=True
    ):
        turned = rotation_from_vector(move[:3]) @ camera.R_cam_head
        x, y, z = camera.t_cam_head
        moved = np.array([x + move[3], y + move[4], z * np.exp(np.clip(move[5], -0.5, 0.5))])
        focal = camera.focal_px * float(np.exp(np.clip(move[6], -0.5, 0.5)))
        cameras.append(replace(camera, R_cam_head=turned, t_cam_head=moved, focal_px=focal))
    weights = state.weights.copy()
    weights[units] = np.clip(weights[units] + step[CAMERA_SIZE * count :], 0, MAX_WEIGHT)
    return UnitFit(tuple(cameras), weights)
