"""MediaPipe over a whole video. Run by benchmarks.track_speed in a process of its own.

Decoded as mien decodes, beside the network; every frame's pose and blendshapes go into a file.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.track_peer import peer_faces
from mien.capture.video.frames_ahead import frames_ahead
from mien.capture.video.video import Video


def main(video: Path, output: Path) -> None:
    """Writes one row a frame."""
    rows: list[Sequence[float]] = []
    with frames_ahead(Video(video)) as pictures:
        frames = ((picture.seconds, picture.pixels) for picture in pictures)
        for face in peer_faces(frames):
            if face is None:
                rows.append([np.nan] * (9 + 3 + 52))
            else:
                rows.append([*face.rotation.ravel(), *face.translation, *face.blendshapes])
    np.savetxt(output, np.array(rows), fmt="%.6g", delimiter=",")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
