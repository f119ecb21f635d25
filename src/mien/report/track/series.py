"""A track's numbers as arrays, and how far they are from the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mien.animate.from_track import FACING
from mien.arrays import Array, Bool, Float, Int
from mien.numeric.rotation import angle_between
from mien.report.page import head_angles_deg
from mien.track.state import Track


@dataclass(frozen=True)
class Series:
    """A track's numbers, NaN where the face was lost.

    Attributes:
        numbers: (N,) of the frames.
        times: (N,) seconds.
        status: (N,).
        rms: (N,) as TrackedFrame's.
        seen: (N,) as TrackedFrame's.
        rotations: (N, 3, 3) R_cam_head.
        angles: (N, 3) degrees of yaw, pitch and roll.
        translations: (N, 3) mm.
        values: (N,) by channel.
        deviations: (N,) by channel.
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
        """(N,)."""
        return np.array([status == "lost" for status in self.status], bool)


def series_of(track: Track) -> Series:
    """The track as arrays."""
    channels, frames = track.layout.channels, track.frames
    shapes = ((3, 3), (3,), (3,), (len(channels),))
    arrays = [np.full((len(frames), *shape), np.nan) for shape in (*shapes, shapes[-1])]
    rotations, angles, translations, values, deviations = arrays
    for row, found in enumerate(frames):
        if found.state is not None:
            rotations[row], translations[row] = found.state.R_cam_head, found.state.t_cam_head
            angles[row] = head_angles_deg(track.camera(found.state))
            values[row], deviations[row] = found.state.values, found.deviations
    lost = np.array([found.state is None for found in frames], bool)
    return Series(
        numbers=np.array([found.frame for found in frames], np.int64),
        times=np.array([found.time for found in frames]),
        status=tuple(found.status for found in frames),
        rms=np.array([found.rms for found in frames]),
        seen=np.where(lost, np.nan, [found.seen for found in frames]),
        rotations=rotations,
        angles=angles,
        translations=translations,
        values=dict(zip(channels, values.T, strict=True)),
        deviations=dict(zip(channels, deviations.T, strict=True)),
    )


def truth_for(track: Track, reference: Track) -> Series:
    """The reference's numbers for the track's frames, by their numbers; NaN where it has none."""
    known = {found.frame: found for found in reference.frames}
    frames = (
        known.get(found.frame, replace(found, status="lost", state=None)) for found in track.frames
    )
    return series_of(replace(reference, frames=tuple(frames)))


def rotation_errors(series: Series, truth: Series) -> Float[Array, " n"]:
    """(N,) degrees between the rotations."""
    both = np.isfinite(series.rotations + truth.rotations).all(axis=(1, 2))
    errors = np.full(len(both), np.nan)
    errors[both] = np.degrees(angle_between(series.rotations[both], truth.rotations[both]))
    return errors


def translation_errors(series: Series, truth: Series) -> Float[Array, " n"]:
    """(N,) distance between the translations, percent of the true distance."""
    apart = np.linalg.norm(series.translations - truth.translations, axis=1)
    return 100 * apart / np.linalg.norm(truth.translations, axis=1)


def quaternions(series: Series) -> Float[Array, "n 4"]:
    """(N, 4) x, y, z, w >= 0 of the rotation out of the camera's view."""
    from scipy.spatial.transform import Rotation

    result = np.full((len(series.rotations), 4), np.nan)
    found = ~series.lost
    if found.any():
        turned = Rotation.from_matrix(series.rotations[found] @ FACING.T)
        result[found] = turned.as_quat(canonical=True)
    return result
