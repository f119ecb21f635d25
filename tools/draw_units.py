"""Draws the picture of docs/method/face-units.md: python -m tools.draw_units HEAD.

HEAD is a head folder, made by `mien build`. Every unit is shown at weight 1: the face from the
front, and where it moves from nearby and from the side.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import GenericHead, load_generic_head
from mien.camera import Camera
from mien.head import Head
from mien.io.head.head_folder import load_head
from mien.render.picture import HeadRenderer
from mien.rig.gaze import SIDES
from mien.rig.state import FaceState

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "face-units.jpg"
_TILE = (200, 240)
_COLUMNS = 6
_DISTANCE_MM = 900.0
_BACKGROUND = (60, 60, 68)
_WITH = {"mouthClose": {"jawOpen": 1.0}, "tongueOut": {"jawOpen": 0.3}}
"""What a unit is shown with that by itself shows nothing, or what cannot be."""


def main(folder: str) -> None:
    """Writes the picture."""
    head, generic = load_head(Path(folder)), load_generic_head()
    tiles = list(_tiles(head, generic))
    tiles += [np.zeros_like(tiles[0])] * (-len(tiles) % _COLUMNS)
    rows = [np.hstack(tiles[at : at + _COLUMNS]) for at in range(0, len(tiles), _COLUMNS)]
    Image.fromarray(np.vstack(rows)).save(PICTURE, quality=82, optimize=True)


def _tiles(head: Head, generic: GenericHead) -> Iterable[UInt8[Array, "h w 3"]]:
    renderer = HeadRenderer(head)
    places = _places(generic, head.mesh.vertices)
    for name in generic.unit_names:
        weights = {name: 1.0, **_WITH.get(name, {})}
        state = FaceState(units=weights)
        front = _look_at((places["eyes"] + places["mouth"]) / 2, width_mm=190)
        near = _near(name, places)
        faces = [
            renderer.draw(state, camera, background=_BACKGROUND)[..., :3]
            for camera in (front, near)
        ]
        yield _labelled(np.hstack(faces), " + ".join(weights))


def _places(generic: GenericHead, vertices: Float[Array, "v 3"]) -> dict[str, Array]:
    """(3,) mm: the eyes, the middle between them, and the mouth's."""
    lids = {side: list(generic.polylines[f"{side}_upper_eyelid"]) for side in SIDES}
    places = {side: vertices[line].mean(axis=0) - [0, 4, 0] for side, line in lids.items()}
    corners = [generic.vertex_of(f"{side}_mouth_corner") for side in SIDES]
    mouth = vertices[corners].mean(axis=0) - [0, 12, 0]
    return places | {"eyes": (places["left"] + places["right"]) / 2, "mouth": mouth}


def _near(unit: str, places: dict[str, Array]) -> Camera:
    """A camera that looks at what the unit moves, from its side."""
    side = "left" if unit.endswith("Left") else "right"
    yaw = 35.0 if side == "left" else -35.0
    if unit.startswith("eye"):
        return _look_at(places[side], width_mm=55, yaw=yaw / 2)
    if unit.startswith(("brow", "cheekSquint", "noseSneer")):
        return _look_at(places["eyes"], width_mm=125, yaw=yaw)
    return _look_at(places["mouth"], width_mm=100, yaw=yaw)


def _look_at(target: Float[Array, " 3"], *, width_mm: float, yaw: float = 0.0) -> Camera:
    """A camera before the target that sees this width; positive yaw: the subject's left side."""
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    rotation = np.diag([1.0, -1.0, -1.0]) @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    place = np.array([0, 0, _DISTANCE_MM]) - rotation @ target
    return Camera(*_TILE, _TILE[0] * _DISTANCE_MM / width_mm, rotation, place)


def _labelled(image: UInt8[Array, "h w 3"], text: str) -> Array:
    picture = Image.fromarray(image)
    ImageDraw.Draw(picture).text((6, 4), text, fill=(255, 255, 255), stroke_width=1, stroke_fill=0)
    return np.asarray(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
