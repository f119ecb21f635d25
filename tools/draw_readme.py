"""The README's picture: the demo's photos and the head that mien makes of them.

Usage: python -m tools.draw_readme
"""

from __future__ import annotations

from math import radians
from pathlib import Path

import cv2
import numpy as np

from mien.app.demo import UNITS, demo_photos
from mien.arrays import Array
from mien.build import build_head
from mien.formats.image import save_image
from mien.model.head import Head
from mien.render.picture import render_head

PLACE = Path(__file__).parents[1] / "docs" / "images" / "readme.jpg"
_SIZE = (360, 450)
_BACKGROUND = (72, 74, 84)


def main() -> None:
    """Build, render, write."""
    result = build_head(demo_photos())
    photos = [_cropped(view.photo.pixels) for view in result.capture.views]
    turned = [_look(result.head, yaw=radians(yaw)) for yaw in (-75, -35, 0, 35)]
    moved = [_look(result.head, yaw=radians(-20), units=units) for units in UNITS.values()]
    rows = [[*photos, *turned[1:3]], [turned[0], turned[3], moved[0], moved[1]]]
    save_image(PLACE, np.vstack([np.hstack(row) for row in rows]), quality=85)


def _look(head: Head, **how: object) -> Array:
    return render_head(head, size=_SIZE, background=_BACKGROUND, **how)[..., :3]  # type: ignore[arg-type]


def _cropped(photo: Array) -> Array:
    """The upper part of a portrait in the pictures' shape."""
    height = min(len(photo), photo.shape[1] * _SIZE[1] // _SIZE[0])
    small: Array = cv2.resize(photo[:height], _SIZE, interpolation=cv2.INTER_AREA)
    return small


if __name__ == "__main__":
    main()
