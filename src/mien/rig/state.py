"""The state of a face, and the posed surface that follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import InitVar, dataclass, field

from mien.arrays import Array, Float, check_array, frozen

FACE = "face"
"""The name under which weights hold everywhere in the face."""


@dataclass(frozen=True)
class Gaze:
    """Direction of gaze, radians from straight ahead.

    Attributes:
        yaw: positive to the subject's left.
        pitch: positive up.

    Raises:
        InputError: not finite.
    """

    yaw: float = 0.0
    pitch: float = 0.0

    def __post_init__(self) -> None:
        check_array("gaze", (self.yaw, self.pitch), (2,))


@dataclass(frozen=True)
class FaceState:
    """Weights of expressions and units, and gaze.

    Attributes:
        expressions: weights of photographed expressions by region: {"face": {"joy": 0.6}} holds
            everywhere, {"mouth": {"anger": 0.4}} instead of it in the mouth, {"left_mouth": ...}
            instead of both in its left half. The rest to 1 is neutral's.
        units: weights of face units by name; 0 to 1 is their usual range, all that a rig takes is
            mien.limits.UNIT_RANGE.
        gaze: where the eyes look.
    """

    expressions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    units: Mapping[str, float] = field(default_factory=dict)
    gaze: Gaze = field(default_factory=Gaze)


@dataclass(frozen=True)
class PosedFace:
    """The consensus geometry, with the weight of each texture at every vertex.

    Attributes:
        vertices: (V, 3) mm, head space.
        weights: (V, K) one for each of the rig's textures, summing to 1 at every vertex; from -0.5
            to 1.5, for a face may go past what was photographed.
        brightness: (V,) factor on the colours: eyes and teeth in the shadow of lids and lips.

    Args:
        finite: check for NaN and infinity; not needed for what was computed from finite numbers.

    Raises:
        InputError: shape, not finite.
    """

    vertices: Float[Array, "v 3"]
    weights: Float[Array, "v k"]
    brightness: Float[Array, " v"]
    finite: InitVar[bool] = True

    def __post_init__(self, finite: bool) -> None:
        count = len(self.vertices)
        shapes = {"vertices": (count, 3), "weights": (count, None), "brightness": (count,)}
        for name, shape in shapes.items():
            array = check_array(name, getattr(self, name), shape, finite=finite)
            object.__setattr__(self, name, frozen(array))
