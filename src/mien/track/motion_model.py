"""The motion expected between two frames: prediction, prior, and blocks for shrinkage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mien.numeric.rotation import rotation_from_vector, rotation_to_vector
from mien.track.face_model import FaceModel
from mien.track.image.drawing import Pose
from mien.track.parameters import GaussianPrior, Parameters
from mien.track.photometric.image_jacobian import LOG_FOCAL
from mien.track.photometric.shrinkage import ParameterBlock
from mien.track.state import TrackedFrame

FRAME_SECONDS = 1 / 25
"""Interval between frames to which the deviations of this module refer."""
_POSE_DEVIATIONS = (0.1, 0.1, 0.1, 15.0, 15.0, 40.0, 0.3)
"""Of the head's motion in a frame: rotation (rad), translation (mm), log focal length."""
_WEIGHT_DEVIATION, _UNIT_DEVIATION, _GAZE_DEVIATION = 0.2, 0.25, 0.2
"""Of the face's motion in a frame. What the pictures do not determine changes as little as this
allows."""
_REST_DEVIATION = 0.4
"""Of units and gaze (rad) around rest, to which what the pictures do not determine returns."""
_POSE_THRESHOLD, _FACE_THRESHOLD = 9.0, 3.0
"""Standard deviations above which a step is motion (ParameterBlock). Errors of the pose correlate
over frames and are larger than its covariance says, and its jitter is visible; a small smile must
not be shrunk."""
_MEASURED_DEVIATION = 0.08
"""Of units and gaze (rad) around those of the detector's landmarks."""


def motion_prior(parameters: Parameters, factor: float) -> GaussianPrior:
    """The prior around predicted parameters; units and gaze tend to rest.

    Args:
        parameters: predicted.
        factor: of the deviations.
    """
    mixing, units = parameters.face.alpha.size, len(parameters.face.units)
    if not mixing:
        deviations = np.array([*_POSE_DEVIATIONS, *[_MEASURED_DEVIATION] * (units + 2)])
        return GaussianPrior(parameters, deviations)
    face_deviations = (
        [_WEIGHT_DEVIATION] * mixing + [_UNIT_DEVIATION] * units + [_GAZE_DEVIATION] * 2
    )
    deviations = factor * np.array([*_POSE_DEVIATIONS, *face_deviations])
    resting = np.s_[len(_POSE_DEVIATIONS) + mixing :]
    # The product of two Gaussians: around the prediction, and around rest.
    remaining = 1 / (1 + (deviations[resting] / _REST_DEVIATION) ** 2)
    deviations[resting] *= np.sqrt(remaining)
    unit_mean, gaze = remaining[:-2] * parameters.face.units, remaining[-2:] * parameters.face.gaze
    face = replace(parameters.face, units=unit_mean, gaze=gaze)
    return GaussianPrior(replace(parameters, face=face), deviations)


def predict(
    parameters: Parameters, last: TrackedFrame, before: TrackedFrame, time: float
) -> Parameters:
    """The pose extrapolated linearly from two frames; the face stays.

    Args:
        parameters: of the last frame.
        last: the last frame; it shows the face.
        before: the frame before it.
        time: seconds, of the next frame.

    Source:
        [Pighin 2002] sec. 6.2.
    """
    assert last.state is not None
    # After the face was found anew, the frame before may show another person's.
    if before is last or before.state is None or last.status == "reacquired":
        return parameters
    ahead = (time - last.time) / max(last.time - before.time, 1e-3)
    ahead = float(np.clip(ahead, 0, 2))
    turn = rotation_to_vector(last.state.R_cam_head @ before.state.R_cam_head.T)
    shift = last.state.t_cam_head - before.state.t_cam_head
    rotation = rotation_from_vector(ahead * turn) @ parameters.pose.R
    return replace(parameters, pose=Pose(rotation, parameters.pose.t + ahead * shift))


def parameter_blocks(model: FaceModel) -> list[ParameterBlock]:
    """Of the unknowns without the focal length: the pose, each region, units, gaze."""
    alpha, units = model.neutral.alpha, len(model.layout.units)
    pose = np.delete(_POSE_DEVIATIONS, LOG_FOCAL)
    regions = [np.full(alpha.shape[1], _WEIGHT_DEVIATION)] * len(alpha)
    face = [*regions, np.full(units, _UNIT_DEVIATION), np.full(2, _GAZE_DEVIATION)]
    ends = np.cumsum([len(pose), *map(len, face)])
    blocks = [ParameterBlock(np.arange(len(pose)), pose, _POSE_THRESHOLD)]
    for end, scale in zip(ends[1:], face, strict=True):
        blocks.append(ParameterBlock(np.arange(end - len(scale), end), scale, _FACE_THRESHOLD))
    return blocks
