"""What the joint solve is told, and what it looks for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import Camera
from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.reconstruction.dense.projection import UNKNOWNS, Pinholes

POSE = UNKNOWNS - 1
"""Unknowns of a photo that it shares with no other: all but the focal length."""
POSE_SD = np.array([0.1, 0.1, 0.1, 30.0, 30.0, 0.6])
"""How far a camera lies from where landmarks put it: rotation (rad); x and y (mm), log depth."""


@dataclass(frozen=True)
class PlacePrior:
    """Beliefs about N places on the head: X_n = mean_n + sum_c c_c B_cn + d_n.

    Attributes:
        mean: (N, 3) mm.
        components: (C, N, 3) mm, B; their coefficients have deviation 1.
        precision: (N, 3, 3) 1 / mm^2, of the deviations d.
    """

    mean: Float[Array, "n 3"]
    components: Float[Array, "c n 3"]
    precision: Float[Array, "n 3 3"]


@dataclass(frozen=True)
class Sightings:
    """M observations: photo m shows place n at image point x.

    Attributes:
        photo: (M,).
        place: (M,).
        image_points: (M, 2) px.
        sigma_px: (M,).
        guides: (M,) whether the cameras follow it. What slides over the face with the view, as a
            detector's landmarks do, may tell the shape, but not the cameras.
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
        group: (K,) index from 0.
        log_focal: (G,) mean and deviation of log(px).
        deviation: (G,) mean and deviation of log(px).
    """

    group: Int[Array, " k"]
    log_focal: Float[Array, " g"]
    deviation: Float[Array, " g"]

    def by_unknown(self, values: Float[Array, "... k 7"]) -> Float[Array, "... d"]:
        """Values by photo as values by unknown, D = 6K + G: poses, then focal lengths."""
        shares = np.eye(len(self.log_focal))[self.group]
        poses = values[..., :POSE].reshape(*values.shape[:-2], -1)
        return np.concatenate([poses, values[..., POSE] @ shares], axis=-1)

    def by_unknowns(self, blocks: Float[Array, "k 7 7"]) -> Float[Array, "d d"]:
        """Each photo's own matrix as one between all unknowns."""
        photos = np.arange(len(blocks))
        square = np.zeros((len(blocks), UNKNOWNS, len(blocks), UNKNOWNS))
        square[photos, :, photos] = blocks
        return self.by_unknown(np.moveaxis(self.by_unknown(square), -1, 0)).T


@dataclass(frozen=True)
class CameraPrior:
    """Beliefs about poses and focal lengths, each by itself.

    Attributes:
        R: (K, 3, 3), t: (K, 3) mm, about which poses lie with POSE_SD.
        lenses: focal lengths.
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    lenses: Lenses

    @property
    def precision(self) -> Float[Array, " d"]:
        """(6K + G,) of the poses' and lenses' unknowns."""
        return np.append(np.tile(POSE_SD**-2, len(self.R)), self.lenses.deviation**-2)

    def off(self, state: JointState) -> Float[Array, " d"]:
        """(6K + G,): how far the unknowns are from what is believed."""
        turned = rotation_to_vector(state.R @ np.swapaxes(self.R, 1, 2))
        shifted = state.t[:, :2] - self.t[:, :2]
        depth = np.log(state.t[:, 2:] / self.t[:, 2:])
        poses = np.concatenate([turned, shifted, depth], axis=1)
        return np.append(poses, state.log_focal - self.lenses.log_focal)


@dataclass(frozen=True)
class JointState:
    """Values of all unknowns.

    Attributes:
        R: (K, 3, 3), t: (K, 3) mm, log_focal: (G,).
        places: (N, 3) mm.
        coefficients: (C,).
    """

    R: Float[Array, "k 3 3"]
    t: Float[Array, "k 3"]
    log_focal: Float[Array, " g"]
    places: Float[Array, "n 3"]
    coefficients: Float[Array, " c"]

    def pinholes(self, group: Int[Array, " k"]) -> Pinholes:
        """The cameras, whose focal lengths are those of their groups."""
        return Pinholes(self.R, self.t, np.exp(self.log_focal)[group])

    def moved(
        self, common: Float[Array, " q"], places: Float[Array, "n 3"], share: float = 1.0
    ) -> JointState:
        """The state after a share of a step: (6K + G + C) and (N, 3) mm."""
        count = POSE * len(self.R)
        poses = share * common[:count].reshape(-1, POSE)
        focal, coefficients = np.split(share * common[count:], [len(self.log_focal)])
        depth = self.t[:, 2] * np.exp(poses[:, 5])
        return JointState(
            rotation_from_vector(poses[:, :3]) @ self.R,
            np.column_stack([self.t[:, :2] + poses[:, 3:5], depth]),
            self.log_focal + focal,
            self.places + share * places,
            self.coefficients + coefficients,
        )


def start_state(
    cameras: Sequence[Camera], places: Float[Array, "n 3"], lenses: Lenses, coefficients: int
) -> JointState:
    """The state at these cameras, with the mean focal length of each lens."""
    pinholes = Pinholes.of(cameras)
    log_focal = np.bincount(lenses.group, np.log(pinholes.focal_px)) / np.bincount(lenses.group)
    return JointState(
        pinholes.R, pinholes.t, log_focal, np.array(places, float), np.zeros(coefficients)
    )


def cameras_at(state: JointState, starts: Sequence[Camera], lenses: Lenses) -> tuple[Camera, ...]:
    """The cameras of a state; what it does not know (sizes, principal points) is the starts'."""
    pinholes = state.pinholes(lenses.group)
    return tuple(
        replace(
            camera,
            R_cam_head=pinholes.R[k],
            t_cam_head=pinholes.t[k],
            focal_px=float(pinholes.focal_px[k]),
        )
        for k, camera in enumerate(starts)
    )
