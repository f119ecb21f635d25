"""The equations of cameras and shape at a state, the places eliminated.

With derivatives a by its camera and b by its place of a residual r of weight w, the precision P
of a place's deviation d, and its components B, the steps y of the cameras, c of the coefficients
and x of each place obey

    places        (P + sum b'wb) x + sum b'wa y - PB c = -Pd - sum b'wr
    coefficients  c + sum B'P (B c - x) = sum B'P d - coefficients
    cameras       sum z'w (a y + b x) = -sum z'wr

and what is believed of each camera by itself. Least squares has z = a; free of its bias are
instruments z (mien.reconstruction.dense.joint), which only guides have.
"""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float
from mien.errors import EstimationError
from mien.reconstruction.dense.gauge import with_frame
from mien.reconstruction.dense.joint_points import (
    Elimination,
    JointProblem,
    Misfit,
    Rows,
    apply_each,
    flat,
    misfit_at,
    own_equations,
)
from mien.reconstruction.dense.joint_problem import JointState
from mien.reconstruction.dense.projection import UNKNOWNS


def linearize(
    problem: JointProblem, state: JointState, *, instruments: bool = True
) -> tuple[Rows, Elimination]:
    """The equations of the common unknowns, as many as there are, and the places' answer.

    Without instruments they are those of least squares: symmetric, and biased.
    """
    misfit = misfit_at(problem, state)
    by_camera = misfit.seen.by_camera()
    columns = _couple(problem, misfit, by_camera)
    places = Elimination(problem, own_equations(problem, state, misfit), columns)
    shape = _shape_rows(problem, state, places)
    if instruments:
        at_mean = problem.project(state, problem.prior.mean).by_camera()
        at_mean *= problem.seen.guides[:, None, None]
        cameras = _camera_rows(problem, state, misfit, at_mean, places)
        cameras = with_frame(cameras, problem, state, misfit, places)
    else:
        cameras = _camera_rows(problem, state, misfit, by_camera, places)
    matrix = np.concatenate([cameras.matrix, shape.matrix])
    return Rows(matrix, np.append(cameras.right, shape.right)), places


def solve_rows(rows: Rows) -> Float[Array, " q"]:
    """The step. Raises: EstimationError: there is none."""
    by_row = 1 / np.maximum(np.abs(rows.matrix).max(axis=1), 1e-300)
    matrix = by_row[:, None] * rows.matrix
    by_column = 1 / np.maximum(np.abs(matrix).max(axis=0), 1e-300)
    try:
        step: Array = by_column * np.linalg.solve(matrix * by_column, by_row * rows.right)
    except np.linalg.LinAlgError as error:
        raise EstimationError(f"the photos do not determine cameras and shape ({error})") from error
    if not np.isfinite(step).all():
        raise EstimationError("the photos do not determine cameras and shape")
    return step


def _couple(
    problem: JointProblem, misfit: Misfit, by_camera: Float[Array, "m 2 7"]
) -> Float[Array, "n 3 d"]:
    """Sums of b'wa over the sightings of each place."""
    weighted = np.swapaxes(misfit.weights[:, None, None] * misfit.seen.by_place, 1, 2)
    sums = problem.by_place_and_photo(weighted @ by_camera)
    by_photo = sums.reshape(len(problem.prior.mean), -1, 3, UNKNOWNS)
    return problem.believed.lenses.by_unknown(np.swapaxes(by_photo, 1, 2))


def _camera_rows(
    problem: JointProblem,
    state: JointState,
    misfit: Misfit,
    instruments: Float[Array, "m 2 7"],
    places: Elimination,
) -> Rows:
    lenses, precision = problem.believed.lenses, problem.believed.precision
    weighted = np.swapaxes(misfit.weights[:, None, None] * instruments, 1, 2)
    blocks = problem.by_photo(weighted @ misfit.seen.by_camera())
    matrix = np.zeros((len(precision), len(precision) + len(state.coefficients)))
    matrix[:, : len(precision)] = lenses.by_unknowns(blocks) + np.diag(precision)
    right = -lenses.by_unknown(problem.by_photo(apply_each(weighted, misfit.residuals)))
    right -= precision * problem.believed.off(state)
    return places.eliminate(_couple(problem, misfit, instruments), Rows(matrix, right))


def _shape_rows(problem: JointProblem, state: JointState, places: Elimination) -> Rows:
    """The coefficients', which a place enters by -B'P."""
    precision, basis = problem.prior.precision, problem.basis
    answered = precision @ places.own.inverse
    cameras = flat(answered @ places.columns).T @ basis
    # A square root halves the work: the product of a matrix with itself is symmetric.
    root = np.linalg.cholesky((1 + 1e-12) * precision - answered @ precision)
    felt = flat(np.swapaxes(root, 1, 2) @ basis.reshape(len(root), 3, -1))
    shape = felt.T @ felt + np.eye(basis.shape[1])
    pull = places.own.pull - apply_each(answered, places.own.gradient)
    return Rows(
        np.concatenate([cameras.T, shape], axis=1), pull.ravel() @ basis - state.coefficients
    )
