"""The bundle adjustment problem: unknowns, observations, priors and normal equations.

Unknown are K cameras with G focal lengths, the coefficients c of a linear shape model, and N points

    X_n = mean_n + sum_i c_i B_in + d_n

whose deviations d_n from the model have a Gaussian prior of precision P_n. Two solvers share this
problem: bundle.adjustment minimizes a cost, dense.joint solves equations with instruments.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.numeric.segment_sum import SegmentSum
from mien.numeric.solvers.schur import BlockSystem
from mien.reconstruction.bundle.projection import (
    CAMERA_SIZE,
    POSE_SIZE,
    PinholeArrays,
    Projection,
    Reprojection,
    project_points,
)

_MAX_LOG_STEP = 3.0
"""Of a depth or focal length."""


@dataclass(frozen=True)
class Observations:
    """M observations: photo m shows point n at image point x.

    Attributes:
        photo: (M,) index of the photo.
        point: (M,) index of the point.
        image_points: (M, 2) px.
        sigma_px: (M,) standard deviation per axis.
        for_cameras: (M,) whether it enters the equations of the cameras (dense.joint). A detector's
            landmark, which slides over the face with the view, may constrain the shape only.
    """

    photo: Int[Array, " m"]
    point: Int[Array, " m"]
    image_points: Float[Array, "m 2"]
    sigma_px: Float[Array, " m"]
    for_cameras: Bool[Array, " m"]


@dataclass(frozen=True)
class PointPrior:
    """Gaussian prior of N points: X_n = mean_n + sum_i c_i B_in + d_n.

    Attributes:
        mean: (N, 3) mm.
        components: (C, N, 3) mm, B; their coefficients have mean 0 and standard deviation 1.
        precision: (N, 3, 3) 1 / mm^2, of the deviations d; 0 where nothing is known.
    """

    mean: Float[Array, "n 3"]
    components: Float[Array, "c n 3"]
    precision: Float[Array, "n 3 3"]


@dataclass(frozen=True)
class FocalGroups:
    """Which photos share a focal length, and the Gaussian prior of each log focal length.

    Attributes:
        group: (K,) index of each photo's group, from 0.
        log_focal: (G,) mean of log(px).
        deviation: (G,) standard deviation of log(px); infinite where nothing is known.
    """

    group: Int[Array, " k"]
    log_focal: Float[Array, " g"]
    deviation: Float[Array, " g"]

    def sum_by_unknown(self, values: Float[Array, "... k 7"]) -> Float[Array, "... d"]:
        """Values of each photo's parameters summed by unknown, D = 6K + G: poses, focal lengths."""
        membership = np.eye(len(self.log_focal))[self.group]
        poses = values[..., :POSE_SIZE].reshape(*values.shape[:-2], -1)
        return np.concatenate([poses, values[..., POSE_SIZE] @ membership], axis=-1)

    def join_blocks(self, blocks: Float[Array, "k 7 7"]) -> Float[Array, "d d"]:
        """Each photo's matrix summed into one over all unknowns."""
        photos = np.arange(len(blocks))
        square = np.zeros((len(blocks), CAMERA_SIZE, len(blocks), CAMERA_SIZE))
        square[photos, :, photos] = blocks
        return self.sum_by_unknown(np.moveaxis(self.sum_by_unknown(square), -1, 0)).T


@dataclass(frozen=True)
class CameraPrior:
    """Independent Gaussian priors of poses and focal lengths.

    Attributes:
        R: (K, 3, 3) mean R_cam_head.
        t: (K, 3) mm, mean t_cam_head.
        focal: the focal lengths.
        pose_deviation: (6,) of rotation vector (rad), x and y (mm) and log depth; infinite where
            nothing is known.
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    focal: FocalGroups
    pose_deviation: Float[Array, " 6"]

    @cached_property
    def precision(self) -> Float[Array, " d"]:
        """(6K + G,) of poses and log focal lengths."""
        return np.append(
            np.tile(self.pose_deviation**-2.0, len(self.R)), self.focal.deviation**-2.0
        )

    def deviations(self, state: BundleState) -> Float[Array, " d"]:
        """(6K + G,) of the state from the means."""
        rotation = rotation_to_vector(state.R @ np.swapaxes(self.R, 1, 2))
        translation = state.t[:, :2] - self.t[:, :2]
        depth = np.log(state.t[:, 2:] / self.t[:, 2:])
        poses = np.concatenate([rotation, translation, depth], axis=1)
        return np.append(poses, state.log_focal - self.focal.log_focal)


@dataclass(frozen=True)
class BundleState:
    """Values of all unknowns.

    Attributes:
        R: (K, 3, 3) R_cam_head.
        t: (K, 3) mm, t_cam_head.
        log_focal: (G,), one a group of photos.
        points: (N, 3) mm.
        coefficients: (C,) of the point prior's components.
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    log_focal: Float[Array, " g"]
    points: Float[Array, "n 3"]
    coefficients: Float[Array, " c"]

    @classmethod
    def of(
        cls,
        cameras: Sequence[Camera],
        points: Float[Array, "n 3"],
        group: Int[Array, " k"],
        coefficients: int,
    ) -> BundleState:
        """These cameras and points, the mean log focal length of each group, coefficients of 0."""
        arrays = PinholeArrays.of(cameras)
        log_focal = np.bincount(group, np.log(arrays.focal_px)) / np.bincount(group)
        return cls(arrays.R, arrays.t, log_focal, np.array(points, float), np.zeros(coefficients))

    def moved(
        self, common: Float[Array, " q"], points: Float[Array, "n 3"], fraction: float = 1.0
    ) -> BundleState:
        """The state after a fraction of a step: (6K + G + C,) and (N, 3) mm."""
        common = fraction * common
        poses, focal, coefficients = np.split(
            common, np.cumsum([POSE_SIZE * len(self.R), len(self.log_focal)])
        )
        poses = poses.reshape(-1, POSE_SIZE)
        log_depth = np.clip(poses[:, 5], -_MAX_LOG_STEP, _MAX_LOG_STEP)
        # Depth moves by a factor, so that focal length and distance trade along a straight line.
        return BundleState(
            rotation_from_vector(poses[:, :3]) @ self.R,
            np.column_stack([self.t[:, :2] + poses[:, 3:5], self.t[:, 2] * np.exp(log_depth)]),
            self.log_focal + np.clip(focal, -_MAX_LOG_STEP, _MAX_LOG_STEP),
            self.points + fraction * points,
            self.coefficients + coefficients,
        )

    def cameras(self, like: Sequence[Camera], group: Int[Array, " k"]) -> tuple[Camera, ...]:
        """The state's cameras, with the sizes and principal points of others."""
        focal_px = np.exp(self.log_focal)[group]
        return tuple(
            replace(
                camera,
                R_cam_head=self.R[k],
                t_cam_head=self.t[k],
                focal_px=float(focal_px[k]),
            )
            for k, camera in enumerate(like)
        )


@dataclass(frozen=True)
class PointBlocks:
    """The points' normal equations while cameras and coefficients stay.

    Attributes:
        information: (N, 3, 3) 1 / mm^2, P + sum b'wb with b the point Jacobian.
        gradient: (N, 3) 1 / mm, P d + sum b'wr.
        prior_gradient: (N, 3), its part P d.
    """

    information: Float[Array, "n 3 3"]
    gradient: Float[Array, "n 3"]
    prior_gradient: Float[Array, "n 3"]


class BundleProblem:
    """What is observed and known beforehand, with what stays the same from step to step.

    Args:
        cameras: K of them, for their principal points.
        observations: M of them.
        point_prior: of the N points.
        camera_prior: of the K cameras.
    """

    def __init__(
        self,
        cameras: Sequence[Camera],
        observations: Observations,
        point_prior: PointPrior,
        camera_prior: CameraPrior,
    ) -> None:
        self.observations, self.point_prior, self.camera_prior = (
            observations,
            point_prior,
            camera_prior,
        )
        principal = np.stack([camera.principal for camera in cameras])
        self.image = observations.image_points - principal[observations.photo]
        count, photos = len(point_prior.mean), len(cameras)
        self.sum_by_point = SegmentSum(observations.point, count)
        self.sum_by_photo = SegmentSum(observations.photo, photos)
        pair = observations.point * photos + observations.photo
        self._sum_by_pair = SegmentSum(pair, count * photos)
        # (3N, C): as one matrix, so that sums over points are single products.
        components = point_prior.components
        self.basis = np.ascontiguousarray(components.reshape(len(components), 3 * count).T)

    def project(self, state: BundleState, points: Float[Array, "n 3"]) -> Projection:
        """The observed points, at these positions, by the state's cameras.

        Raises:
            EstimationError: a point lies behind its camera.
        """
        focal_px = np.exp(state.log_focal)[self.camera_prior.focal.group]
        cameras = PinholeArrays(state.R, state.t, focal_px)
        return project_points(cameras, self.observations.photo, points[self.observations.point])

    def point_deviations(self, state: BundleState) -> Float[Array, "n 3"]:
        """(N, 3) mm: d, the points less what the components explain."""
        return (
            state.points - self.point_prior.mean - (self.basis @ state.coefficients).reshape(-1, 3)
        )

    def point_blocks(self, state: BundleState, at: Reprojection) -> PointBlocks:
        """Normal equations of each point by itself."""
        jacobian, precision = at.projection.point_jacobian, self.point_prior.precision
        weighted = _weighted(at, jacobian)
        prior_gradient = apply_each(precision, self.point_deviations(state))
        return PointBlocks(
            precision + self.sum_by_point(weighted @ jacobian),
            prior_gradient + self.sum_by_point(apply_each(weighted, at.residuals)),
            prior_gradient,
        )

    def camera_equations(
        self, state: BundleState, at: Reprojection, left: Float[Array, "m 2 7"]
    ) -> tuple[Float[Array, "d d"], Float[Array, "n d 3"], Float[Array, " d"]]:
        """The camera equations.

        sum z'w (a y + b x) + S y = -sum z'wr - S s, with prior precision S and deviation s.

        Args:
            state: at which they are linearized.
            at: its reprojection errors r, weights w, and Jacobians a of cameras, b of points.
            left: z; the camera Jacobian makes them those of least squares.

        Returns:
            (D, D) of the camera step y, (N, D, 3) of the point steps x, and minus the right side.
        """
        focal, precision = self.camera_prior.focal, self.camera_prior.precision
        weighted = _weighted(at, left)
        own = focal.join_blocks(self.sum_by_photo(weighted @ at.projection.camera_jacobian()))
        gradient = focal.sum_by_unknown(self.sum_by_photo(apply_each(weighted, at.residuals)))
        pairs = self._sum_by_pair(_weighted(at, at.projection.point_jacobian) @ left)
        by_photo = pairs.reshape(len(state.points), -1, 3, CAMERA_SIZE)
        coupling = focal.sum_by_unknown(np.swapaxes(by_photo, 1, 2))
        return (
            own + np.diag(precision),
            np.swapaxes(coupling, 1, 2),
            gradient + precision * self.camera_prior.deviations(state),
        )

    def normal_equations(self, state: BundleState, at: Reprojection) -> BlockSystem:
        """Of least squares in the step: cameras and coefficients in common, a block a point."""
        points = self.point_blocks(state, at)
        own, coupling, gradient = self.camera_equations(state, at, at.projection.camera_jacobian())
        size = len(own)
        common = np.zeros((size + self.basis.shape[1], size + self.basis.shape[1]))
        common[:size, :size] = own
        common[size:, size:] = self._coefficient_information
        by_coefficients = state.coefficients - points.prior_gradient.ravel() @ self.basis
        # In memory by point, axis and unknown: as BlockSystem reads it.
        joined = np.concatenate([np.swapaxes(coupling, 1, 2), -self._weighted_basis], axis=2)
        return BlockSystem(
            common,
            points.information,
            np.swapaxes(joined, 1, 2),
            np.append(gradient, by_coefficients),
            points.gradient,
        )

    @cached_property
    def _weighted_basis(self) -> Float[Array, "n 3 c"]:
        """P B."""
        return self.point_prior.precision @ self.basis.reshape(
            len(self.point_prior.mean), 3, self.basis.shape[1]
        )

    @cached_property
    def _coefficient_information(self) -> Float[Array, "c c"]:
        """B'P B, and the coefficients' own prior."""
        weighted = self._weighted_basis.reshape(self.basis.shape)
        return self.basis.T @ weighted + np.eye(self.basis.shape[1])


def apply_each(matrices: Float[Array, "n a b"], vectors: Float[Array, "n b"]) -> Array:
    """(N, A): every matrix times its vector."""
    return (matrices @ vectors[..., None])[..., 0]


def _weighted(at: Reprojection, jacobian: Float[Array, "m 2 a"]) -> Float[Array, "m a 2"]:
    return np.swapaxes(at.weights[:, None, None] * jacobian, 1, 2)
