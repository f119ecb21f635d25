"""A track's numbers as arrays, and their errors against a reference."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.arrays import Array, Bool, Float, Int
from mien.camera import FRONTAL, head_angles_deg
from mien.numeric.rotation import angle_between
from mien.track.state import Track


@dataclass(frozen=True)
class Series:
    """A track's numbers, NaN where the face was lost.

    Attributes:
        numbers: (N,) of the frames, counted from 0.
        times: (N,) seconds.
        status: (N,).
        rms: (N,) grey levels, as TrackedFrame.rms.
        seen: (N,) shares from 0 to 1, as TrackedFrame.seen.
        rotations: (N, 3, 3) R_cam_head.
        angles: (N, 3) degrees of yaw, pitch and roll.
        translations: (N, 3) mm.
        values: (N,) by channel of the layout.
        deviations: (N,) standard deviations by channel.
    """

    numbers: Int[Array, " n"]
    times: Float[Array, " n"]
    status: tuple[str, ...]
    rms: Float[Array, " n"]
    seen: Float[Array, " n"]
    rotations: Float[Array, "n 3 3"]
    angles: Float[Array, "n 3"]
    translations: Float[Array, "n 3"]
    values: dict[str, Float[Array, " n"]]
    deviations: dict[str, Float[Array, " n"]]

    @property
    def lost(self) -> Bool[Array, " n"]:
        """(N,) where the face was lost."""
        return np.array([status == "lost" for status in self.status], bool)


def series_of(track: Track) -> Series:
    """The track as arrays."""
    channels, frames = track.layout.channels, track.frames
    shapes = ((3, 3), (3,), (3,), (len(channels),))
    arrays = [np.full((len(frames), *shape), np.nan) for shape in (*shapes, shapes[-1])]
    rotations, angles, translations, values, deviations = arrays
    for row, frame in enumerate(frames):
        if frame.state is not None:
            rotations[row], translations[row] = frame.state.R_cam_head, frame.state.t_cam_head
            angles[row] = head_angles_deg(track.camera(frame.state))
            values[row], deviations[row] = frame.state.values, frame.deviations
    lost = np.array([frame.state is None for frame in frames], bool)
    return Series(
        numbers=np.array([frame.frame for frame in frames], np.int64),
        times=np.array([frame.time for frame in frames]),
        status=tuple(frame.status for frame in frames),
        rms=np.array([frame.rms for frame in frames]),
        seen=np.where(lost, np.nan, [frame.seen for frame in frames]),
        rotations=rotations,
        angles=angles,
        translations=translations,
        values=dict(zip(channels, values.T, strict=True)),
        deviations=dict(zip(channels, deviations.T, strict=True)),
    )


def truth_for(track: Track, reference: Track) -> Series:
    """The reference as arrays over the track's frames; NaN where it has no frame of that number."""
    known = {frame.frame: frame for frame in reference.frames}
    frames = (
        known.get(frame.frame, replace(frame, status="lost", state=None)) for frame in track.frames
    )
    return series_of(replace(reference, frames=tuple(frames)))


def rotation_errors(series: Series, truth: Series) -> Float[Array, " n"]:
    """(N,) angles between the rotations, degrees."""
    both = np.isfinite(series.rotations + truth.rotations).all(axis=(1, 2))
    errors = np.full(len(both), np.nan)
    errors[both] = np.degrees(angle_between(series.rotations[both], truth.rotations[both]))
    return errors


def translation_errors(series: Series, truth: Series) -> Float[Array, " n"]:
    """(N,) distances between the translations, percent of the true distance."""
    distances = np.linalg.norm(series.translations - truth.translations, axis=1)
    return 100 * distances / np.linalg.norm(truth.translations, axis=1)


def quaternions(series: Series) -> Float[Array, "n 4"]:
    """(N, 4) x, y, z and w >= 0 of the rotations relative to a head that faces the camera."""
    from scipy.spatial.transform import Rotation

    result = np.full((len(series.rotations), 4), np.nan)
    known = ~series.lost
    if known.any():
        relative = Rotation.from_matrix(series.rotations[known] @ FRONTAL.T)
        result[known] = relative.as_quat(canonical=True)
    return result
