"""What tracking finds: head and face in every frame of a video."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mien.arrays import Array, Float, check_array, check_positive, check_rotation, frozen
from mien.camera import Camera
from mien.errors import InputError
from mien.head import NEUTRAL
from mien.rig.state import FaceState, Gaze

Status = Literal["ok", "reacquired", "lost"]
STATUSES: tuple[Status, ...] = ("ok", "reacquired", "lost")
"""Followed from the frame before; found anew by the detector; not found."""

GAZE = ("gaze.yaw", "gaze.pitch")


@dataclass(frozen=True)
class Layout:
    """What there is a number for in every frame.

    Attributes:
        regions: those whose expressions are independent, such as mouth, eyes and forehead.
        expressions: photographed ones, neutral first.
        units: face units.
    """

    regions: tuple[str, ...]
    expressions: tuple[str, ...]
    units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.expressions[:1] != (NEUTRAL,):
            raise InputError("expressions", "neutral first", ", ".join(self.expressions) or "none")

    @property
    def weight_channels(self) -> tuple[str, ...]:
        """`mouth.joy` for every blending weight, row after row; none where all is neutral."""
        if len(self.expressions) == 1:
            return ()
        return tuple(f"{region}.{name}" for region in self.regions for name in self.expressions)

    @property
    def channels(self) -> tuple[str, ...]:
        """Of weights, of units (`units.jawOpen`), and of the gaze."""
        return (*self.weight_channels, *(f"units.{name}" for name in self.units), *GAZE)


@dataclass(frozen=True)
class TrackState:
    """Head and face in one frame.

    Attributes:
        R_cam_head: (3, 3).
        t_cam_head: (3,) mm.
        weights: (R, K) blending weights by region; every row sums to 1.
        units: (U,) weights of face units.
        gaze: (2,) radians, yaw to the subject's left and pitch up.

    Raises:
        InputError: shapes, not finite, no rotation.
    """

    R_cam_head: Float[Array, "3 3"]
    t_cam_head: Float[Array, " 3"]
    weights: Float[Array, "r k"]
    units: Float[Array, " u"]
    gaze: Float[Array, " 2"]

    def __post_init__(self) -> None:
        rotation = check_rotation("R_cam_head", self.R_cam_head)
        object.__setattr__(self, "R_cam_head", frozen(rotation))
        shapes = {"t_cam_head": (3,), "weights": (None, None), "units": (None,), "gaze": (2,)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(check_array(name, getattr(self, name), shape)))

    def face(self, layout: Layout) -> FaceState:
        """What a rig understands."""
        expressions = {
            region: dict(zip(layout.expressions[1:], row.tolist(), strict=True))
            for region, row in zip(layout.regions, self.weights[:, 1:], strict=True)
        }
        units = dict(zip(layout.units, self.units.tolist(), strict=True))
        return FaceState(expressions, units, Gaze(*self.gaze.tolist()))

    @property
    def values(self) -> Float[Array, " c"]:
        """(C,) in the order of the layout's channels."""
        weights = self.weights.ravel() if self.weights.shape[1] > 1 else np.empty(0)
        return np.concatenate([weights, self.units, self.gaze])


@dataclass(frozen=True)
class TrackedFrame:
    """What one frame shows.

    Attributes:
        frame: counted from 0.
        time: seconds.
        status: how it was found.
        state: None where it is lost.
        rms: grey levels (0 to 255), root mean square difference of the frame and the drawn face
            over the face, colours matched by gain and bias; NaN where it is lost.
        seen: share of the face mask that is not covered or outside of the frame, from 0 to 1.
        deviations: (C,) standard deviation of each of the layout's channels: how well the frame
            determines it. What the frame says nothing about has that of the prior.
        gain: (3,) frame = gain * drawn + bias, of colours from 0 to 255.
        bias: (3,) frame = gain * drawn + bias, of colours from 0 to 255.
    """

    frame: int
    time: float
    status: Status
    state: TrackState | None
    rms: float
    seen: float
    deviations: Float[Array, " c"]
    gain: Float[Array, " 3"]
    bias: Float[Array, " 3"]


@dataclass(frozen=True)
class Track:
    """Head and face in every frame of a video; `series_of` gives its numbers as arrays.

    Attributes:
        layout: of every frame's numbers.
        width: of the video's pictures, upright; the principal point is in their middle.
        height: as `width`.
        focal_px: as `width`.
        fps: frames a second, their mean where it varies.
        frames: in the order of their times.
    """

    layout: Layout
    width: int
    height: int
    focal_px: float
    fps: float
    frames: tuple[TrackedFrame, ...]

    def __post_init__(self) -> None:
        for name in ("width", "height", "focal_px", "fps"):
            check_positive(name, getattr(self, name))

    def camera(self, state: TrackState) -> Camera:
        """The camera that sees the head as the video does."""
        size = (self.width, self.height)
        return Camera(*size, self.focal_px, state.R_cam_head, state.t_cam_head)
