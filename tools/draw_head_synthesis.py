"""Draws the picture of docs/guide/synthesize.md: python -m tools.draw_head_synthesis HEAD.

HEAD is a head folder with the expressions of `cap13_edit2.mp4`, made by `mien build`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from mien.arrays import Array, Float
from mien.camera import Camera
from mien.head import NEUTRAL
from mien.io.head.head_folder import load_head
from mien.render.orbit import orbit_camera
from mien.render.picture import HeadRenderer
from mien.rig.state import FACE, FaceState
from mien.synthesis.heads.synthesizer import HeadSynthesizer
from mien.synthesis.inference.coefficients import UPPER_FACE

IMAGE = Path(__file__).parents[1] / "docs" / "images" / "synthesis-head.jpg"
_TILE = (250, 310)
_BACKGROUND = (72, 74, 84)
_YAWS = (-30, 0, 30)
_MIXED = (("brows_up", "left_", "upper_teeth"), ("eyes_closed", "left_", "open_mouth"))
"""Whose upper face, which side of it, and whose face otherwise."""
_MOVED: Mapping[str, tuple[float, float, float]] = {
    "left_brow_upper.2": (0, 6, 0),
    "right_brow_upper.2": (0, 0, 0),
    "left_mouth_corner": (5, 5, -3),
    "right_mouth_corner": (0, 0, 0),
    "menton": (0, -10, -2),
}
"""Mm by which some points leave their places at rest."""


class Pictures:
    """Tiles of one head."""

    def __init__(self, folder: str) -> None:
        head = load_head(folder)
        self.synthesizer = HeadSynthesizer(head)
        self._renderer = HeadRenderer(head, rig=self.synthesizer.rig)
        self.points = dict(zip(self.synthesizer.rig.names, self.synthesizer.examples, strict=True))

    def _camera(self, yaw: float) -> Camera:
        """Close enough to show the face alone."""
        width, height = _TILE
        places = self.synthesizer.examples.reshape(-1, 3)
        turned = np.radians(-yaw)
        return orbit_camera(turned, width=width, height=height, vertices=places, margin=0.08)

    def of_expression(self, name: str, text: str) -> Array:
        """The head as photographed, from the front."""
        state = FaceState({FACE: {name: 1.0}})
        drawn = self._renderer.draw(state, self._camera(0), background=_BACKGROUND)
        return _labelled(drawn[..., :3], text)

    def from_points(self, points: Float[Array, "n 3"]) -> list[Array]:
        """The expression of the points, from three sides."""
        face, tiles = self.synthesizer.synthesize(points).face, []
        for yaw in _YAWS:
            drawn = self._renderer.draw_posed(face, self._camera(yaw), background=_BACKGROUND)
            tiles.append(drawn[..., :3])
        return tiles

    def mixed(self, above: str, side: str, below: str) -> list[Array]:
        """Points of two expressions together."""
        layout, regions = self.synthesizer.layout, self.synthesizer.subregions
        members = dict(zip(regions.names, regions.members, strict=True))
        upper = np.unique(np.concatenate([members[name] for name in UPPER_FACE]))
        chosen = [index for index in upper if layout.names[index].startswith(side)]
        points = np.array(self.points[below])
        points[chosen] = self.points[above][chosen]
        labels = f"{above}: {side.strip('_')} eye and brow", f"{below}: all else"
        own = [
            self.of_expression(name, text)
            for name, text in zip((above, below), labels, strict=True)
        ]
        return [*own, *self.from_points(points)]

    def moved(self) -> list[Array]:
        """A few points at rest, the same where they are asked for, and the face."""
        layout, rest = self.synthesizer.layout, self.points[NEUTRAL]
        known = np.array([layout.index(name) for name in _MOVED])
        asked = rest[known] + np.array(list(_MOVED.values()))
        tiles = [
            self._marked(rest[known], "at rest", (255, 255, 255)),
            self._marked(asked, "asked for", (255, 190, 60)),
        ]
        return [*tiles, *self.from_points(self.synthesizer.complete(known, asked))]

    def _marked(self, places: Array, text: str, colour: tuple[int, int, int]) -> Array:
        image = Image.fromarray(self.of_expression(NEUTRAL, text))
        draw = ImageDraw.Draw(image)
        for x, y in self._camera(0).project(places):
            draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=colour, outline=(0, 0, 0))
        return np.asarray(image)


def _labelled(tile: Array, text: str) -> Array:
    image = Image.fromarray(np.ascontiguousarray(tile))
    ImageDraw.Draw(image).text((6, 4), text, fill=(255, 255, 255), stroke_width=1, stroke_fill=0)
    return np.asarray(image)


def main(folder: str) -> None:
    """Writes the picture."""
    pictures = Pictures(folder)
    rows = [pictures.mixed(*mixed) for mixed in _MIXED]
    rows.append(pictures.moved())
    sheet = np.concatenate([np.concatenate(row, axis=1) for row in rows])
    Image.fromarray(sheet).save(IMAGE, quality=88)


if __name__ == "__main__":
    main(sys.argv[1])
