"""MediaPipe's face landmarker as its users run it on videos: tracking, smoothed, one face."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import numpy as np

from mien.arrays import Array, Float, UInt8
from mien.assets.networks import detector_model_path

__all__ = ["PeerFace", "VideoLandmarker", "peer_faces"]

_Y_DOWN_Z_FORWARD = np.diag([1.0, -1.0, -1.0])
"""From MediaPipe's camera space (x right, y up, z backward) to mien's."""
_CM = 10.0


@dataclass(frozen=True)
class PeerFace:
    """What it finds in a frame.

    Attributes:
        points: (478, 2) px.
        blendshapes: (52,).
        rotation: (3, 3), translation: (3,) mm, from its canonical face to mien's camera space.
    """

    points: Float[Array, "478 2"]
    blendshapes: Float[Array, " 52"]
    rotation: Float[Array, "3 3"]
    translation: Float[Array, " 3"]


class VideoLandmarker:
    """The network in video mode, with blendshapes and the pose of the head."""

    def __init__(self) -> None:
        import mediapipe
        from mediapipe.tasks.python import BaseOptions, vision

        self._mediapipe = mediapipe
        self._network: Any = vision.FaceLandmarker.create_from_options(
            vision.FaceLandmarkerOptions(
                base_options=BaseOptions(model_asset_path=str(detector_model_path())),
                running_mode=vision.RunningMode.VIDEO,
                output_face_blendshapes=True,
                output_facial_transformation_matrixes=True,
            )
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._network.close()

    def step(self, pixels: UInt8[Array, "h w 3"], milliseconds: int) -> PeerFace | None:
        """The face in the next frame, if there is one."""
        image = self._mediapipe.Image(
            image_format=self._mediapipe.ImageFormat.SRGB, data=np.ascontiguousarray(pixels)
        )
        result = self._network.detect_for_video(image, milliseconds)
        if not result.face_landmarks:
            return None
        height, width = pixels.shape[:2]
        points = np.array([(mark.x, mark.y) for mark in result.face_landmarks[0]])
        matrix = np.asarray(result.facial_transformation_matrixes[0], np.float64)
        left, scale, right = np.linalg.svd(matrix[:3, :3])
        return PeerFace(
            points * [width, height],
            np.array([category.score for category in result.face_blendshapes[0]]),
            _Y_DOWN_Z_FORWARD @ left @ right,
            _Y_DOWN_Z_FORWARD @ matrix[:3, 3] * _CM / scale.mean(),
        )


def peer_faces(
    frames: Iterable[tuple[float, UInt8[Array, "h w 3"]]],
) -> Iterator[PeerFace | None]:
    """The face in every frame; frames come with their seconds."""
    with VideoLandmarker() as network:
        last = -1
        for seconds, pixels in frames:
            # It wants milliseconds that grow.
            last = max(last + 1, round(1000 * seconds))
            yield network.step(pixels, last)
