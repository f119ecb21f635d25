"""Rotations as matrices and rotation vectors (axis times angle), single or in batches."""

from __future__ import annotations

import numpy as np

from mien.arrays import Array, Float

__all__ = ["angle_between", "cross_matrix", "rotation_from_vector", "rotation_to_vector"]


def rotation_from_vector(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """Rodrigues' formula: rotation by |vector| radians about vector; exact at and near 0.

    Source:
        [Pighin 2002] app. A, eq. (12).
    """
    from scipy.spatial.transform import Rotation

    vector = np.array(vector, dtype=np.float64)
    matrices: Array = Rotation.from_rotvec(vector.reshape(-1, 3)).as_matrix()
    return matrices.reshape(*vector.shape, 3)


def rotation_to_vector(rotation: Float[Array, "*batch 3 3"]) -> Float[Array, "*batch 3"]:
    """The inverse of rotation_from_vector, with an angle in [0, pi]; safe near both ends."""
    from scipy.spatial.transform import Rotation

    # A copy: SciPy takes no array that is read-only.
    rotation = np.array(rotation, dtype=np.float64)
    if not rotation.size:
        return rotation[..., 0]  # No rotation at all: older SciPy refuses that.
    vectors: Array = Rotation.from_matrix(rotation.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(rotation.shape[:-1])


def angle_between(
    a: Float[Array, "*batch 3 3"], b: Float[Array, "*batch 3 3"]
) -> Float[Array, "*batch"]:
    """Angle in radians of the rotation that takes a to b."""
    relative = np.asarray(b) @ np.swapaxes(np.asarray(a), -1, -2)
    return np.linalg.norm(rotation_to_vector(relative), axis=-1)


def cross_matrix(vector: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3 3"]:
    """X(v), the matrix of the cross product: X(v) u = v x u. Source: [Pighin 2002] eq. (13)."""
    vector = np.asarray(vector, dtype=np.float64)
    matrix = np.zeros((*vector.shape, 3))
    x, y, z = np.moveaxis(vector, -1, 0)
    matrix[..., 0, 1], matrix[..., 0, 2] = -z, y
    matrix[..., 1, 0], matrix[..., 1, 2] = z, -x
    matrix[..., 2, 0], matrix[..., 2, 1] = -y, x
    return matrix
