"""What integrating over the unknown positions of points adds to a cost of cameras.

Cameras and points of highest joint probability are biased where points are many and uncertain: in
the joint optimum every point takes its most probable position, and how wide the region of
probable positions is under these cameras does not count. Two long lenses show it: the angle between
them trades with the relief of the shape at almost no cost, and the joint optimum settles degrees
off, always to the same side. The cameras of highest probability over *all* positions of the
points do not suffer from that. For points with a Gaussian prior the integral is known: each adds
half the logarithm of the determinant of its normal matrix to the cost.
"""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float

__all__ = ["point_evidence"]


def point_evidence(
    R: Float[Array, "k 3 3"],
    t: Float[Array, "k 3"],
    focal: Float[Array, " k"],
    precision: Float[Array, "k n"],
    points: Float[Array, "n 3"],
    sigma: Float[Array, " n"],
) -> tuple[float, Float[Array, "k 7"]]:
    """Half the sum over points of log det(1 + sigma_i^2 sum_k J_ki^T J_ki), and its gradient.

    Args:
        R: head to camera, mm.
        t: head to camera, mm.
        focal: px.
        precision: (K, N) of the observations, 1 / px; 0 unseen.
        points: (N, 3) mm at which the derivatives J_ki of the projections are taken.
        sigma: (N,) mm, of the points' priors; infinite ones are passed over.

    Returns:
        the value, 0 or more, and (K, 7) its derivatives by each photo's step: rotation vector,
        shift in x and y, log depth (of t), log focal length.
    """
    held = np.isfinite(sigma)
    precision, points = precision[:, held], points[held]
    sigma = sigma[held]
    rotated = points @ np.swapaxes(R, 1, 2)
    x, y, z = np.moveaxis(rotated + t[:, None], -1, 0)
    scale = focal[:, None] * precision / z
    by_camera = np.zeros((*x.shape, 2, 3))
    by_camera[..., 0, 0], by_camera[..., 0, 2] = scale, -scale * x / z
    by_camera[..., 1, 1], by_camera[..., 1, 2] = scale, -scale * y / z
    by_point = by_camera @ R[:, None]
    stacked = np.swapaxes(by_point, 0, 1).reshape(len(points), -1, 3)
    normal = np.eye(3) + sigma[:, None, None] ** 2 * (np.swapaxes(stacked, 1, 2) @ stacked)
    value = 0.5 * float(np.linalg.slogdet(normal)[1].sum())

    # d(log det)/2 = tr(normal^-1 sigma^2 J^T dJ); with E = sigma^2 J normal^-1 R^T and J = C R it
    # is the product of E with dC + C X(v), C depending on the point in camera space.
    inverse = sigma[:, None, None] ** 2 * np.linalg.inv(normal)
    e = by_point @ inverse @ np.swapaxes(R, 1, 2)[:, None]
    by_point_in_camera = np.empty(rotated.shape)
    by_point_in_camera[..., 0] = -scale / z * e[..., 0, 2]
    by_point_in_camera[..., 1] = -scale / z * e[..., 1, 2]
    own = (e * by_camera).sum(axis=(-2, -1))
    by_point_in_camera[..., 2] = scale / z**2 * (x * e[..., 0, 2] + y * e[..., 1, 2]) - own / z
    turning = np.cross(rotated, by_point_in_camera) + np.cross(e, by_camera).sum(axis=-2)
    gradient = np.empty((len(R), 7))
    gradient[:, :3] = turning.sum(axis=1)
    gradient[:, 3:5] = by_point_in_camera[..., :2].sum(axis=1)
    gradient[:, 5] = by_point_in_camera[..., 2].sum(axis=1) * t[:, 2]
    gradient[:, 6] = own.sum(axis=1)
    return value, gradient
