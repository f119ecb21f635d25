"""One camera from points on a known head, with a prior of the focal length."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector
from mien.numeric.solvers.levenberg_marquardt import minimize_lm
from mien.numeric.solvers.robust import loss_named
from mien.reconstruction.bundle.projection import PinholeArrays, project_points

_NEAREST_MM = 150.0
"""No photo of a head is taken from nearer by."""


@dataclass(frozen=True)
class FocalLengthPrior:
    """Focal length in px and its relative deviation."""

    focal_px: float
    deviation: float


def refine_camera(
    camera: Camera,
    points: Float[Array, "n 3"],
    image_points: Float[Array, "n 2"],
    *,
    sigma_px: float,
    focal: FocalLengthPrior,
    loss: str = "cauchy",
) -> Camera | None:
    """The camera of highest posterior near this one; None where it comes too near to the head."""
    problem = _Problem(points, image_points, sigma_px, focal, loss)
    found = minimize_lm(
        camera,
        cost=problem.cost,
        linearize=problem.linearize,
        move=_moved,
        max_iterations=30,
        tolerance=1e-6,
    ).x
    return found if found.t_cam_head[2] > _NEAREST_MM else None


@dataclass(frozen=True)
class _Problem:
    points: Float[Array, "n 3"]
    image_points: Float[Array, "n 2"]
    sigma_px: float
    focal: FocalLengthPrior
    loss: str

    def cost(self, camera: Camera) -> float:
        in_camera = camera.to_camera(self.points)
        if in_camera[:, 2].min() <= 0:
            return float("inf")
        residuals = (camera.project(self.points) - self.image_points) / self.sigma_px
        rho = loss_named(self.loss)((residuals**2).sum(axis=1))[0]
        return 0.5 * float(rho.sum() + self._focal_off(camera) ** 2)

    def linearize(self, camera: Camera) -> Callable[[float], tuple[Array, float]]:
        """Gauss-Newton for a rotation vector, a shift (mm) and a change of log focal length."""
        residuals = (camera.project(self.points) - self.image_points) / self.sigma_px
        weights = loss_named(self.loss)((residuals**2).sum(axis=1))[1]
        jacobian = _jacobian(camera, self.points) / self.sigma_px
        normal = np.einsum("nij,n,nik->jk", jacobian, weights, jacobian, optimize=True)
        gradient = np.einsum("nij,n,ni->j", jacobian, weights, residuals, optimize=True)
        normal[6, 6] += 1 / self.focal.deviation**2
        gradient[6] += self._focal_off(camera) / self.focal.deviation

        def solve(damping: float) -> tuple[Array, float]:
            damped = normal + damping * np.diag(np.diag(normal))
            step = -np.linalg.solve(damped, gradient)
            return step, float(-gradient @ step - 0.5 * step @ normal @ step)

        return solve

    def _focal_off(self, camera: Camera) -> float:
        return float(np.log(camera.focal_px / self.focal.focal_px)) / self.focal.deviation


def _moved(camera: Camera, step: Float[Array, " 7"]) -> Camera:
    return replace(
        camera,
        R_cam_head=rotation_from_vector(step[:3]) @ camera.R_cam_head,
        t_cam_head=camera.t_cam_head + step[3:6],
        focal_px=camera.focal_px * float(np.exp(np.clip(step[6], -1, 1))),
    )


def _jacobian(camera: Camera, points: Float[Array, "n 3"]) -> Float[Array, "n 2 7"]:
    """Derivatives of the projection by a rotation after R, by t and by log focal length."""
    photo = np.zeros(len(points), np.int64)
    projection = project_points(PinholeArrays.of([camera]), photo, points)
    jacobian = projection.camera_jacobian()
    jacobian[..., 5] = projection.rotated_jacobian[..., 2]
    return jacobian
