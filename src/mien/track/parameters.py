"""[Pighin 2002]'s parameters p of one frame, and the prior on them (sec. 6.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.track.face_model import FaceParameters
from mien.track.image.drawing import Pose
from mien.track.photometric.image_jacobian import (
    LOG_FOCAL,
    POSE_UNKNOWNS,
    ROTATION,
    TRANSLATION,
)


@dataclass(frozen=True)
class Parameters:
    """[Pighin 2002]'s parameters p: where the head is and what the face does."""

    pose: Pose
    face: FaceParameters

    def plus(self, step: Float[Array, " n"]) -> Parameters:
        """After a step in all unknowns: R <- R^ R, everything else by addition.

        Source:
            [Pighin 2002] app. B.2.
        """
        import cv2

        rotation = cv2.Rodrigues(np.asarray(step[ROTATION]))[0] @ self.pose.R
        zoom = self.pose.zoom * float(np.exp(step[LOG_FOCAL]))
        pose = Pose(rotation, self.pose.t + step[TRANSLATION], zoom)
        return Parameters(pose, self.face.plus(step[POSE_UNKNOWNS:]))

    def minus(self, other: Parameters) -> Float[Array, " n"]:
        """The step that leads from the other parameters to these: the inverse of plus."""
        import cv2

        # Never near a half turn, where this is less exact than numeric.rotation, and far quicker.
        rotation = cv2.Rodrigues(self.pose.R @ other.pose.R.T)[0].ravel()
        log_focal = np.log(self.pose.zoom / other.pose.zoom)
        face = self.face.vector - other.face.vector
        return np.concatenate([rotation, self.pose.t - other.pose.t, [log_focal], face])


@dataclass(frozen=True)
class GaussianPrior:
    """What is expected of a frame's parameters before its pixels are compared.

    Attributes:
        mean: the expected parameters.
        deviations: (N,) standard deviations of a step away from them, independent of each other.
    """

    mean: Parameters
    deviations: Float[Array, " n"]
