"""[Pighin 2002]'s parameters p, and what is expected of them (sec. 6.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mien.arrays import Array, Float
from mien.track.face_model import FaceParameters
from mien.track.image.drawing import Pose
from mien.track.photometric.image_jacobian import POSE_UNKNOWNS


@dataclass(frozen=True)
class Guess:
    """[Pighin 2002]'s parameters p: where the head is and what the face does."""

    pose: Pose
    face: FaceParameters

    def moved(self, step: Float[Array, " n"]) -> Guess:
        """After a step in all unknowns: R <- R^ R, everything else by addition.

        Source:
            [Pighin 2002] app. B.2.
        """
        import cv2

        turned = cv2.Rodrigues(np.asarray(step[:3]))[0] @ self.pose.R
        zoom = self.pose.zoom * float(np.exp(step[6]))
        pose = Pose(turned, self.pose.t + step[3:6], zoom)
        return Guess(pose, self.face.moved(step[POSE_UNKNOWNS:]))

    def since(self, other: Guess) -> Float[Array, " n"]:
        """The step that leads here from another."""
        import cv2

        # Never near a half turn, where this is less exact than numeric.rotation, and far quicker.
        turn = cv2.Rodrigues(self.pose.R @ other.pose.R.T)[0].ravel()
        zoom = np.log(self.pose.zoom / other.pose.zoom)
        face = self.face.vector - other.face.vector
        return np.concatenate([turn, self.pose.t - other.pose.t, [zoom], face])


@dataclass(frozen=True)
class Belief:
    """What is expected before the picture is looked at.

    Attributes:
        mean: the likeliest.
        deviations: (N,) standard deviations of a step away from it, each by itself.
    """

    mean: Guess
    deviations: Float[Array, " n"]
