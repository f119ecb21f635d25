"""Notes on the faces of a clip, counted over its frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mien.arrays import Array, UInt8
from mien.capture.faces.landmarks import is_cut
from mien.capture.faces.mediapipe_face import DetectedFace


@dataclass
class ClipNotes:
    """Counts frames, those with several faces, and those whose edge cuts the face."""

    frames: int = 0
    several_faces: int = 0
    cut: int = 0

    def add_frame(self, pixels: UInt8[Array, "h w 3"], faces: Sequence[DetectedFace]) -> None:
        """Count a frame and its faces, px of the frame, the one that is used first."""
        self.frames += 1
        self.several_faces += len(faces) > 1
        size = (pixels.shape[1], pixels.shape[0])
        self.cut += bool(faces) and is_cut(faces[0].points[:, :2], size)

    @property
    def notes(self) -> list[str]:
        """One of each kind."""
        notes = []
        if self.several_faces:
            frames = f"{self.several_faces} of {self.frames} frames"
            notes.append(f"several faces in {frames}: the largest of each is used")
        if self.cut:
            notes.append(f"the edge cuts the face in {self.cut} of {self.frames} frames")
        return notes
