"""Draws the pictures of docs/guide/expressions.md: python -m tools.draw_expressions HEAD.

HEAD is a head folder with several expressions, made by `mien build`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from mien.arrays import Array, Float, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.head import NEUTRAL, Head
from mien.io.files.image import load_image
from mien.io.head.head_folder import load_head
from mien.render.orbit import orbit_camera
from mien.render.picture import HeadRenderer
from mien.render.shade import render
from mien.rig.regions import MASK_NAMES, default_masks
from mien.rig.state import FACE, FaceState

IMAGES = Path(__file__).parents[1] / "docs" / "images"
_TILE = (260, 320)
_BACKGROUND = (72, 74, 84)
_SHOWN = 5
_COLOURS = ((214, 69, 65), (244, 179, 80), (63, 195, 128), (77, 208, 225), (83, 109, 254))
_COLOURS_LAST = (186, 104, 200)


def main(folder: str) -> None:
    """Writes the pictures."""
    place = Path(folder)
    head = load_head(place)
    draw = HeadRenderer(head)
    chosen = [name for name in head.expressions if name != NEUTRAL][:_SHOWN]
    _save("expressions-own.jpg", [_own_row(draw, place, name) for name in chosen])
    _save("expressions-mixed.jpg", _mixtures(draw, chosen))
    _save("expressions-regions.jpg", [_regions()])


def _own_row(draw: HeadRenderer, place: Path, name: str) -> list[Array]:
    """The photo, the head from the photo's camera, from the left and from the right."""
    view = draw.head.expressions[name].views[0]
    photo = load_image(place / "photos" / view.photo)
    state = FaceState({FACE: {name: 1.0}})
    box = _face_box(draw.head, name, view.camera)
    again = draw.draw(state, view.camera, background=_BACKGROUND)[..., :3]
    sides = [_picture(draw, state, yaw) for yaw in (-0.5, 0.5)]
    tiles = [_cut(photo, box), _cut(again, box), *sides]
    return [_labelled(tiles[0], name), *tiles[1:]]


def _mixtures(draw: HeadRenderer, names: Sequence[str]) -> list[list[Array]]:
    """For each expression: halfway, past it, half of it and half of the next, by region."""
    rows = []
    for index, name in enumerate(names):
        other = names[(index + 1) % len(names)]
        states = {
            f"{name} 0.5": {FACE: {name: 0.5}},
            "1.25": {FACE: {name: 1.25}},
            f"0.5 + {other} 0.5": {FACE: {name: 0.5, other: 0.5}},
            "mouth": {"mouth": {name: 1.0}},
            "eyes, forehead": {"eyes": {name: 1.0}, "forehead": {name: 1.0}},
            f"mouth; {other} above": {
                "mouth": {name: 1.0},
                "eyes": {other: 1.0},
                "forehead": {other: 1.0},
            },
        }
        rows.append(
            [_labelled(_picture(draw, FaceState(state)), text) for text, state in states.items()]
        )
    return rows


def _regions() -> list[Array]:
    """The default masks on the generic head, from the front and from a side."""
    generic = load_generic_head()
    masks = default_masks(generic)
    colours = np.array([*_COLOURS, _COLOURS_LAST], float)
    mixed = sum(
        masks[name][:, None] * colour for name, colour in zip(MASK_NAMES, colours, strict=True)
    )
    rest = 1 - np.sum([masks[name] for name in MASK_NAMES], axis=0)
    painted = mixed + rest[:, None] * 150.0
    vertices = generic.mesh.vertices
    return [
        render(
            generic.mesh,
            orbit_camera(yaw, width=2 * _TILE[0], height=2 * _TILE[1], vertices=vertices),
            vertex_colours=painted,
            samples=4,
            background=_BACKGROUND,
        )[..., :3]
        for yaw in (0.0, 0.7)
    ]


def _picture(draw: HeadRenderer, state: FaceState, yaw: float = 0.0) -> UInt8[Array, "h w 3"]:
    width, height = _TILE
    front = _front(draw.head)
    camera = orbit_camera(yaw, width=width, height=height, vertices=front, margin=0.02)
    return draw.draw(state, camera, background=_BACKGROUND)[..., :3]


def _front(head: Head) -> Float[Array, "n 3"]:
    """The face without its sides, which frames it closely."""
    face = head.mesh.vertices[load_generic_head().regions["face"] > 0.1]
    narrow = face[np.abs(face[:, 0]) < 55]
    return narrow[narrow[:, 2] > narrow[:, 2].max() - 70]


def _face_box(head: Head, name: str, camera: Camera) -> tuple[float, float, float, float]:
    """Left, top, right, bottom, px, of the face with the tile's proportions."""
    face = load_generic_head().regions["face"] > 0.1
    pixels = camera.project(head.expressions[name].vertices[face])
    middle, height = pixels.mean(axis=0), 1.25 * float(np.ptp(pixels[:, 1]))
    half = np.array([height * _TILE[0] / _TILE[1], height]) / 2
    (left, top), (right, bottom) = middle - half, middle + half
    return float(left), float(top), float(right), float(bottom)


def _cut(image: UInt8[Array, "h w 3"], box: tuple[float, float, float, float]) -> Array:
    return np.asarray(
        Image.fromarray(image).transform(
            _TILE, Image.Transform.EXTENT, box, Image.Resampling.BICUBIC
        )
    )


def _labelled(image: UInt8[Array, "h w 3"], text: str) -> Array:
    picture = Image.fromarray(image)
    ImageDraw.Draw(picture).text((6, 4), text, fill=(255, 255, 255), stroke_width=1, stroke_fill=0)
    return np.asarray(picture)


def _save(name: str, rows: Sequence[Sequence[Array]]) -> None:
    whole = np.vstack([np.hstack(list(row)) for row in rows])
    Image.fromarray(whole).save(IMAGES / name, quality=84, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
