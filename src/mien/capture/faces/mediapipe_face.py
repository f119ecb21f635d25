"""MediaPipe's face landmarker: typed, and without its messages on stderr."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.errors import MienError

RIGHT_IRIS, LEFT_IRIS = 468, 473
UPPER_LIP, LOWER_LIP = 13, 14
MAX_FACES = 8

BLENDSHAPE_NAMES = (
    "_neutral",
    "browDownLeft",
    "browDownRight",
    "browInnerUp",
    "browOuterUpLeft",
    "browOuterUpRight",
    "cheekPuff",
    "cheekSquintLeft",
    "cheekSquintRight",
    "eyeBlinkLeft",
    "eyeBlinkRight",
    "eyeLookDownLeft",
    "eyeLookDownRight",
    "eyeLookInLeft",
    "eyeLookInRight",
    "eyeLookOutLeft",
    "eyeLookOutRight",
    "eyeLookUpLeft",
    "eyeLookUpRight",
    "eyeSquintLeft",
    "eyeSquintRight",
    "eyeWideLeft",
    "eyeWideRight",
    "jawForward",
    "jawLeft",
    "jawOpen",
    "jawRight",
    "mouthClose",
    "mouthDimpleLeft",
    "mouthDimpleRight",
    "mouthFrownLeft",
    "mouthFrownRight",
    "mouthFunnel",
    "mouthLeft",
    "mouthLowerDownLeft",
    "mouthLowerDownRight",
    "mouthPressLeft",
    "mouthPressRight",
    "mouthPucker",
    "mouthRight",
    "mouthRollLower",
    "mouthRollUpper",
    "mouthShrugLower",
    "mouthShrugUpper",
    "mouthSmileLeft",
    "mouthSmileRight",
    "mouthStretchLeft",
    "mouthStretchRight",
    "mouthUpperUpLeft",
    "mouthUpperUpRight",
    "noseSneerLeft",
    "noseSneerRight",
)
"""What the network scores, in its order."""

_NOISE = re.compile(rb"^(WARNING: Logging before InitGoogle|INFO: |[IW]\d{4} )")

# MediaPipe's camera space has x right, y up, z backward; ours has x right, y down, z forward.
_Y_DOWN_Z_FORWARD = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class DetectedFace:
    """One face as the network detects it.

    Attributes:
        points: (478, 3) px of the image; z forward in the scale of x, its zero at the face.
        blendshapes: (52,) scores in [0, 1].
        R_cam_head: (3, 3), by the network's own assumption of a moderately wide lens.
    """

    points: Float[Array, "478 3"]
    blendshapes: Float[Array, " 52"]
    R_cam_head: Float[Array, "3 3"]

    @property
    def width(self) -> float:
        """Extent in px along the wider image axis."""
        return float(np.ptp(self.points[:, :2], axis=0).max())

    @property
    def lip_gap(self) -> float:
        """Gap between the lips over the distance of the eyes."""
        gap = self.points[UPPER_LIP, :2] - self.points[LOWER_LIP, :2]
        eyes = self.points[RIGHT_IRIS, :2] - self.points[LEFT_IRIS, :2]
        return float(np.linalg.norm(gap) / max(float(np.linalg.norm(eyes)), 1e-6))


def yaw_pitch(R_cam_head: Float[Array, "3 3"]) -> tuple[float, float]:
    """Radians: the head turned to its own left, and tipped down, relative to the camera.

    They are the camera's direction in head space, so a roll of the picture changes neither.
    """
    x, y, z = -R_cam_head[2]
    return float(-np.arcsin(np.clip(x, -1.0, 1.0))), float(np.arctan2(y, z))


class FaceNetwork:
    """The network, loaded once (0.3 s). Use as a context manager, or call `close`.

    Raises:
        MienError: a shared library of the system is missing; names it.
    """

    def __init__(self, model: Path) -> None:
        with _quiet_stderr(), _libraries_explained():
            import mediapipe
            from mediapipe.tasks.python import BaseOptions, vision

            self._mediapipe = mediapipe
            self._network: Any = vision.FaceLandmarker.create_from_options(
                vision.FaceLandmarkerOptions(
                    base_options=BaseOptions(model_asset_path=str(model)),
                    output_face_blendshapes=True,
                    output_facial_transformation_matrixes=True,
                    num_faces=MAX_FACES,
                )
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the network; it cannot be used afterwards."""
        with _quiet_stderr():
            self._network.close()

    def faces(self, pixels: UInt8[Array, "h w 3"]) -> list[DetectedFace]:
        """Every face that the network finds in an upright sRGB image, in no particular order."""
        image = self._mediapipe.Image(
            image_format=self._mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(pixels)
        )
        with _quiet_stderr():
            result = self._network.detect(image)
        height, width = pixels.shape[:2]
        extent = np.array([width, height, width], dtype=np.float64)
        return [
            DetectedFace(
                np.array([(mark.x, mark.y, mark.z) for mark in marks]) * extent,
                np.array([category.score for category in categories]),
                _Y_DOWN_Z_FORWARD @ _nearest_rotation(matrix[:3, :3]),
            )
            for marks, categories, matrix in zip(
                result.face_landmarks,
                result.face_blendshapes,
                result.facial_transformation_matrixes,
                strict=True,
            )
        ]


def _nearest_rotation(matrix: Array) -> Float[Array, "3 3"]:
    """The network's matrix carries a scale and single-precision noise."""
    left, _, right = np.linalg.svd(np.asarray(matrix, dtype=np.float64))
    return left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right


@contextmanager
def _libraries_explained() -> Iterator[None]:
    """A loader's error as one line that names the library and how to install it."""
    try:
        yield
    except (ImportError, OSError) as error:
        library = re.search(r"(lib[\w+-]+\.(?:so|dylib)[.\d]*)", str(error))
        if library is None:
            raise
        raise MienError(
            f"the face detector needs {library[1]}, which this system lacks: install it with "
            "`apt-get install libegl1 libgles2 libgl1` (or your system's packages of that kind)"
        ) from error


@contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Drop MediaPipe's log lines, and pass on whatever else is written meanwhile.

    It is written by C++ straight to file descriptor 2 before any option of MediaPipe's can take
    effect, hence the redirection.
    """
    with ExitStack() as stack:
        try:
            sys.stderr.flush()
            # There may be no place for such a file on a read-only system.
            kept = stack.enter_context(tempfile.TemporaryFile())
            saved = os.dup(2)
        except (AttributeError, OSError, ValueError):
            yield
            return
        os.dup2(kept.fileno(), 2)
        try:
            yield
        finally:
            with suppress(ValueError):
                sys.stderr.flush()
            os.dup2(saved, 2)
            os.close(saved)
            kept.seek(0)
            os.write(2, b"".join(line for line in kept if not _NOISE.match(line)))
