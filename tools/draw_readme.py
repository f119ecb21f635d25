"""The README's pictures: the demo's photos, the head that mien makes of them, and it in motion.

Usage: python -m tools.draw_readme
"""

from __future__ import annotations

from math import radians
from pathlib import Path

import cv2
import numpy as np

from mien.animate.perform import moved_camera, sample_timeline
from mien.arrays import Array
from mien.io.files.image import save_image
from mien.io.timeline.timeline_json import load_timeline_json
from mien.pipelines.build import build_head
from mien.pipelines.demo import UNITS, demo_photos
from mien.render.picture import HeadRenderer, render_head
from mien.rig.state import FaceState

IMAGES = Path(__file__).parents[1] / "docs" / "images"
_SECONDS = (1.0, 1.83, 2.9, 4.0, 4.75, 6.7, 8.6)
"""Of the sample timeline: speaking, looking around, smiling, raising the brows."""
_SIZE = (360, 450)
_BACKGROUND = (72, 74, 84)


def main() -> None:
    """Build, render, write."""
    result = build_head(demo_photos())
    photos = [_cropped(view.photo.pixels) for view in result.capture.views]
    head = HeadRenderer(result.head)
    turned = [_look(head, yaw=yaw) for yaw in (-75, -35, 0, 35)]
    moved = [_look(head, yaw=-20, state=FaceState(units=units)) for units in UNITS.values()]
    rows = [[*photos, *turned[1:3]], [turned[0], turned[3], moved[0], moved[1]]]
    save_image(IMAGES / "readme.jpg", np.vstack([np.hstack(row) for row in rows]), quality=85)
    save_image(IMAGES / "animation.jpg", np.hstack(_performing(head)), quality=85)


def _look(head: HeadRenderer, *, yaw: float, state: FaceState | None = None) -> Array:
    turn = radians(yaw)
    picture = render_head(head, yaw=turn, size=_SIZE, state=state, background=_BACKGROUND)
    return picture[..., :3]


def _performing(head: HeadRenderer) -> list[Array]:
    """Frames of the sample timeline, without the empty sides."""
    timeline = load_timeline_json(sample_timeline())
    camera, pictures = head.camera(size=_SIZE), []
    for time in _SECONDS:
        moment = timeline.at(time)
        seen_from = moved_camera(camera, moment)
        picture = head.draw(moment.state, seen_from, background=_BACKGROUND)
        pictures.append(picture[40:-40, 60:-60, :3])
    return pictures


def _cropped(photo: Array) -> Array:
    """The upper part of a portrait in the pictures' shape."""
    height = min(len(photo), photo.shape[1] * _SIZE[1] // _SIZE[0])
    return cv2.resize(photo[:height], _SIZE, interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main()
