"""Expressions in a report: each beside its photo, and mixed by region."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from mien.arrays import Array, Bool, UInt8
from mien.assets.generic import load_generic_head
from mien.camera import Camera
from mien.head import NEUTRAL, FittedView, Head
from mien.render.picture import GREY, HeadRenderer
from mien.render.shade import over_background, render
from mien.report.pictures import data_uri
from mien.report.track.comparison import face_psnr
from mien.rig.state import FACE, FaceState

MIXTURES = {
    "half of it": {FACE: 0.5},
    "in the mouth": {"mouth": 1.0},
    "around the eyes": {"eyes": 1.0},
    "in the forehead": {"forehead": 1.0},
}
"""Weights of an expression by region, by their captions in the report."""
_HEIGHT = 420
_MARGIN = 0.04


def count_expressions(head: Head) -> int:
    """Number of expressions that a report shows; 0 for a head with neutral alone."""
    return len(head.expressions) if len(head.expressions) > 1 else 0


def expression_rows(
    head: Head,
    photos: Mapping[str, UInt8[Array, "h w 3"]],
    progress: Callable[[int], None] = lambda done: None,
) -> list[dict[str, Any]]:
    """For each expression its photo, its picture from that camera, and mixtures with neutral.

    Args:
        head: with at least one expression besides neutral; else there are no rows.
        photos: pixels by name.
        progress: called with the number of expressions done.
    """
    if not count_expressions(head):
        return []
    renderer = HeadRenderer(head)
    rows = []
    for done, (name, expression) in enumerate(head.expressions.items(), 1):
        view = max(expression.views, key=lambda item: _facing(item.camera), default=None)
        if view is not None:
            rows.append(_row(renderer, name, view, photos[view.photo]))
        progress(done)
    return rows


def expression_psnr(
    renderer: HeadRenderer, name: str, view: FittedView, photo: UInt8[Array, "h w 3"]
) -> tuple[float, UInt8[Array, "h w 4"]]:
    """PSNR in dB over the face between an expression's rendering and its photo; the rendering.

    Colours are converted to the photo's exposure.
    """
    picture = renderer.draw(FaceState({FACE: {name: 1.0}}), view.camera)
    colours = np.clip(np.rint(picture[..., :3] / view.gains), 0, 255).astype(np.uint8)
    picture = np.concatenate([colours, picture[..., 3:]], axis=2)
    # Pixels at the head's outline also show the background.
    inside = _face_pixels(renderer.head, name, view.camera) & (picture[..., 3] == 255)
    return face_psnr(photo, picture, inside), picture


def _row(
    renderer: HeadRenderer, name: str, view: FittedView, photo: UInt8[Array, "h w 3"]
) -> dict[str, Any]:
    psnr, picture = expression_psnr(renderer, name, view, photo)
    box = _box(picture[..., 3] > 0)
    factor = min(1.0, _HEIGHT / (box[0].stop - box[0].start))
    shown = {view.photo: photo, "mien": over_background(picture, GREY)[..., :3]}
    pictures = {caption: _small(image[box], factor) for caption, image in shown.items()}
    if name != NEUTRAL:
        camera = view.camera.resized(factor)
        mixed = _mixtures(renderer, name, camera).items()
        pictures |= {caption: image[_scaled(box, factor)] for caption, image in mixed}
    return {
        "name": name,
        "psnr": psnr,
        "pictures": [{"caption": c, "source": data_uri(image)} for c, image in pictures.items()],
    }


def _mixtures(
    renderer: HeadRenderer, name: str, camera: Camera
) -> dict[str, UInt8[Array, "h w 3"]]:
    pictures = {}
    for caption, regions in MIXTURES.items():
        state = FaceState({region: {name: weight} for region, weight in regions.items()})
        pictures[caption] = renderer.draw(state, camera, background=GREY)[..., :3]
    return pictures


def _face_pixels(head: Head, name: str, camera: Camera) -> Bool[Array, "h w"]:
    """Mask of the face, without the rest of the head."""
    grey = np.where(load_generic_head().regions["face"] > 0.5, 255.0, 0.0)
    colours = np.repeat(grey[:, None], 3, axis=1)
    image = render(head.expression_mesh(name), camera, vertex_colours=colours)
    return (image[..., 0] > 200) & (image[..., 3] > 0)


def _facing(camera: Camera) -> float:
    """Cosine between the face and the direction to the camera."""
    return float(-camera.R_cam_head[2, 2])


def _box(mask: Bool[Array, "h w"]) -> tuple[slice, slice]:
    """Bounding box of the head with a margin."""
    sides = []
    for axis, length in enumerate(mask.shape):
        at = np.flatnonzero(mask.any(axis=1 - axis))
        margin = round(_MARGIN * length)
        low, high = (at[0], at[-1] + 1) if len(at) else (0, length)
        sides.append(slice(max(0, low - margin), min(length, high + margin)))
    return sides[0], sides[1]


def _scaled(box: tuple[slice, slice], factor: float) -> tuple[slice, slice]:
    rows, columns = (slice(round(side.start * factor), round(side.stop * factor)) for side in box)
    return rows, columns


def _small(picture: UInt8[Array, "h w 3"], factor: float) -> UInt8[Array, "h w 3"]:
    import cv2

    return cv2.resize(picture, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
